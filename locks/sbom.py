"""The bill of materials of miurafab: `dist/miurafab.cdx.json`, CycloneDX 1.6, from the lock file.

    python locks/sbom.py

It lists each library of `locks/run.txt` with its version, its hashes and what needs it. The same
lock file gives the same bytes: a time and a serial number are left out, as the format allows.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
_PIN = re.compile(r"([a-z0-9][a-z0-9._-]*)==([^ ;]+)", re.IGNORECASE)


def components(lock: str) -> tuple[list[dict[str, Any]], dict[str, list[str]]]:
    """The libraries of the ``lock`` file's text, and which of them each one needs."""
    found: list[dict[str, Any]] = []
    needs: dict[str, list[str]] = {}
    for line in lock.splitlines():
        pin = _PIN.match(line)
        if pin is not None:
            name, version = pin[1], pin[2]
            purl = f"pkg:pypi/{name}@{version}"
            found.append(
                {
                    "type": "library",
                    "bom-ref": purl,
                    "name": name,
                    "version": version,
                    "purl": purl,
                    "hashes": [],
                }
            )
        elif "--hash=sha256:" in line:
            content = line.partition("sha256:")[2].split()[0]
            found[-1]["hashes"].append({"alg": "SHA-256", "content": content})
        elif found and line.strip().startswith("#"):
            user = line.strip("# ").removeprefix("via").strip()
            if user and not user.startswith("-r"):
                needs.setdefault(user.split()[0], []).append(found[-1]["bom-ref"])
    return found, needs


def bill(lock: str, version: str) -> dict[str, Any]:
    """The document."""
    found, needs = components(lock)
    ours = f"pkg:pypi/miurafab@{version}"
    names = {"miurafab": ours} | {each["name"]: each["bom-ref"] for each in found}
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": ours,
                "name": "miurafab",
                "version": version,
                "purl": ours,
                "licenses": [{"license": {"id": "Apache-2.0"}}],
            }
        },
        "components": found,
        "dependencies": [
            {"ref": ref, "dependsOn": sorted(needs.get(name, []))} for name, ref in names.items()
        ],
    }


def main() -> None:
    """Write the bill of the checkout."""
    text = (ROOT / "miurafab" / "version.py").read_text(encoding="utf-8")
    version = re.findall(r'__version__ = "([^"]+)"', text)[0]
    document = bill((ROOT / "locks" / "run.txt").read_text(encoding="utf-8"), version)
    (ROOT / "dist").mkdir(exist_ok=True)
    path = ROOT / "dist" / "miurafab.cdx.json"
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
