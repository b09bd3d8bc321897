"""The certificate of a studio that other computers reach: from files, or made.

A made certificate (ECDSA on P-256, one year, RFC 5280) is signed by itself, so a browser warns of
it. A person compares its SHA-256 fingerprint with the one that the terminal shows. It is kept for
the next start in the user's state folder, its key in a file of mode 0600.
"""

from __future__ import annotations

import contextlib
import datetime
import hashlib
import importlib
import ipaddress
import ssl
from pathlib import Path
from typing import Any

from miurafab.errors import InputError
from miurafab.files import as_file_name, new_folder, read_bytes, read_text, state_folder, write_text
from miurafab.studio.hosting import Hosting

_DAYS, _RENEWED_DAYS = 365, 30
_CURVE = "SECP256R1"


def tls_of(hosting: Hosting) -> tuple[ssl.SSLContext, str]:
    """The TLS of the server, 1.2 or later, and the fingerprint of its certificate.

    Raises :class:`~miurafab.errors.InputError` for files that are none, and where a certificate
    is to be made without the library for it.
    """
    certificate, key = hosting.certificate, hosting.certificate_key
    if certificate is None or key is None:
        certificate = key = _made(hosting.host)
    text = read_text(certificate, InputError, "a certificate in PEM")
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    try:
        first = text[: text.index(ssl.PEM_FOOTER) + len(ssl.PEM_FOOTER)]
        body = ssl.PEM_cert_to_DER_cert(first[first.index(ssl.PEM_HEADER) :])
        context.load_cert_chain(certificate, key, password=_no_password)
    except (OSError, ValueError) as fault:  # ssl.SSLError is an OSError
        reason = getattr(fault, "reason", None) or getattr(fault, "strerror", None) or fault
        raise InputError(
            f"{certificate} and {key} are not a certificate and its key in PEM, without a "
            f"password: {str(reason).replace('_', ' ').lower()}."
        ) from None
    return context, fingerprint(body)


def fingerprint(certificate: bytes) -> str:
    """The SHA-256 of a ``certificate`` in DER, as browsers show it.

    >>> fingerprint(b"")[:11]
    'E3:B0:C4:42'
    """
    return hashlib.sha256(certificate).digest().hex(":").upper()


def _no_password() -> str:
    """OpenSSL would ask for it in the terminal."""
    return ""


def _made(host: str) -> Path:
    """The file of the certificate for ``host`` and its key, made if there is none that is good for
    some time.
    """
    try:
        x509: Any = importlib.import_module("cryptography.x509")
        serialization: Any = importlib.import_module("cryptography.hazmat.primitives.serialization")
    except ImportError:
        raise InputError(
            "A certificate is made by the library cryptography: install it by 'pip install "
            "miurafab[host]', or give files by `certificate` and `certificate_key`."
        ) from None
    folder = new_folder(state_folder() / "certificates", "The folder of certificates")
    file = folder / f"{as_file_name(host.replace(':', '-'))}.pem"
    now = datetime.datetime.now(datetime.UTC)
    with contextlib.suppress(ValueError, InputError):
        there = x509.load_pem_x509_certificate(read_bytes(file, InputError))
        if there.not_valid_after_utc - now > datetime.timedelta(days=_RENEWED_DAYS):
            return file
    ec: Any = importlib.import_module("cryptography.hazmat.primitives.asymmetric.ec")
    key = ec.generate_private_key(getattr(ec, _CURVE)())
    text = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    ) + _signed(x509, host, key, now).public_bytes(serialization.Encoding.PEM)
    write_text(file, text.decode("ascii"), private=True)
    return file


def _signed(x509: Any, host: str, key: Any, now: datetime.datetime) -> Any:
    hashes: Any = importlib.import_module("cryptography.hazmat.primitives.hashes")
    name = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, "miurafab studio")])
    try:
        known: Any = x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        known = x509.DNSName(host)
    return (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(days=1))
        .not_valid_after(now + datetime.timedelta(days=_DAYS))
        .add_extension(x509.SubjectAlternativeName([known]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(key, hashes.SHA256())
    )
