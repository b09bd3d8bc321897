"""Damaged files of every format that miurafab reads: each is read, or refused in one sentence.

    python benchmarks/fuzz.py [--count N] [--seed N] [FORMAT ...]

Files of `tests/corpus` are changed at random: bytes, numbers, tokens and blocks are replaced,
doubled, moved between files and removed. A reader must return, or raise one of the errors of
miurafab: one line without control characters, with the name of the file. Anything else is printed,
and kept in `fuzz-found`. The same seed makes the same files. `--count` is for each format.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import miurafab as mf
from miurafab.errors import InputError, MiurafabError, is_plain
from miurafab.fabrication.layout import read_head, read_layout
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.stock import read_stock
from miurafab.gcode.reading import read_program
from miurafab.grbl import replies as grbl
from miurafab.machine.actions import read_dump
from miurafab.machine.journal import read_journal
from miurafab.machine.resume import resume
from miurafab.marlin import replies as marlin
from miurafab.options import read_options
from miurafab.origami.fitting.request import FitOptions
from miurafab.origami.formats.crease_lines import lines_of
from miurafab.origami.formats.files import load
from miurafab.origami.formats.fold import fold_text
from miurafab.origami.formats.lines import opx_text
from miurafab.origami.formats.svg import svg_text
from miurafab.studio import orders
from miurafab.surfaces.formula import computed, formula_surface
from miurafab.surfaces.height_field import read_image
from miurafab.surfaces.mesh_files import read_mesh
from miurafab.surfaces.profile_files import read_profile
from miurafab.units import parse_angle, parse_feed, parse_length
from miurafab.wire.line_reader import LineReader
from miurafab.workflow.check_job import check_job
from miurafab.workflow.dry_run import read_gcode
from miurafab.workflow.job_directory import read_job
from miurafab.workflow.job_files import settle_job
from miurafab.workflow.manifest import LAYOUT, MANIFEST, read_manifest, sha256
from miurafab.workflow.whole_folder import ORDER, STAGING

CORPUS = Path(__file__).parent.parent / "tests" / "corpus"
SLOW_S = 10.0
"""No file may take longer, in seconds of processor time."""
_LONG_S = 2.0
"""The slowest file of a format is kept if it takes longer."""
NUMBERS = (
    "0", "-0", "-1", "1e999", "-1e999", "1e308", "1e-320", "nan", "NaN", "Infinity", "9" * 25,
    "9" * 400, "9" * 5000, "1_0", "²", "٣", "0x10", "1e", ".", "+-3", "4294967296", "2147483648",
    "65536", "1e18", "0.1e-400", "", "true", "null",
)  # fmt: skip
TOKENS = (
    "[" * 2000, "{" * 500, "<g>" * 1500, '{"a":' * 1200, "\x00", "\x1b[2J", "\\u001b]0;x\\u0007",
    "\\ud800", "\xff\xfe", "../../etc/passwd", "/dev/zero", "\n", "\r", '"', "'", "<!ENTITY a 'b'>",
    "&a;", "%", "(", ")", "😀", "\u202e", "#", ";", "/*", "-->", "]]>", "[[", "]]", "=", ",,", "$",
    "~", "!", "?",
)  # fmt: skip
MACHINES = {
    ".plt": mf.load_machine("hpgl-cutter-a3"),
    ".nc": mf.load_machine("grbl-laser-400"),
}
JOB = read_gcode(CORPUS / "gcode" / "sheet.nc")


def _pattern(path: Path) -> None:
    pattern = load(path)
    fold_text(pattern, "title")
    lines = lines_of(pattern)
    svg_text(lines, "title")
    opx_text(lines, "title")
    mf.check(path if path.suffix == ".fold" else pattern)


def _pair(path: Path) -> None:
    load(path, folded=path.with_name("folded.obj"))


def _mesh(path: Path) -> None:
    read_mesh(path)
    mf.design(path)


def _gcode(path: Path) -> None:
    read_program(read_gcode(path), MACHINES[path.suffix])


def _layout(path: Path) -> None:
    text = path.read_bytes().decode("utf-8", "replace")
    read_head(text, path)
    read_layout(text, path)


@contextlib.contextmanager
def _about(path: Path) -> Iterator[None]:
    """A refusal that may name something else than ``path``: a job, or a file that is made."""
    try:
        yield
    except MiurafabError as fault:
        raise InputError(f"{path}: {fault.sentence}") from None


def _journal(path: Path) -> None:
    runs = [replace(run, sha256=JOB.sha256) for run in read_journal(path)]
    with _about(path):
        resume(JOB, MACHINES[".nc"], runs)


def _job(path: Path) -> None:
    """A job one of whose files is damaged, with the sums of its manifest made right."""
    manifest = path.with_name(MANIFEST)
    if path != manifest:
        document = json.loads(manifest.read_bytes())
        document["files"] = {name: sha256(path.with_name(name)) for name in document["files"]}
        manifest.write_text(json.dumps(document))
    with _about(path):
        found = (*check_job(path.parent).findings, *read_job(path.parent, unread=True).findings)
    for finding in found:
        wrong = _check_sentence(finding.sentence, None)
        if wrong:
            raise AssertionError(wrong)


def _calibration(path: Path) -> None:
    new = path.with_name("new.toml")
    new.unlink(missing_ok=True)
    with _about(path):
        mf.add_material(new, path.parent, cell="A1", cut="X1", kerf=0.2)


def _unfinished(path: Path) -> None:
    """What a killed writer left, with a damaged order."""
    staging = path.parent / STAGING
    staging.mkdir(exist_ok=True)
    (staging / ORDER).write_bytes(path.read_bytes())
    (staging / LAYOUT).write_bytes(b"new")
    settle_job(path.parent)


def _replies(path: Path) -> None:
    reader = LineReader()
    for line in reader.take(path.read_bytes()):
        grbl.parse_reply(line)
        marlin.parse_reply(line)


def _order(path: Path) -> None:
    body = path.read_bytes()
    faults = 0
    for read in (orders.read_fit, orders.read_layout, orders.read_source):
        try:
            read(body)
        except InputError:
            faults += 1
    if faults == 3:
        raise InputError(f"{path} is no order.")


def _formula(text: str) -> None:
    for read in (
        computed,
        lambda text: formula_surface((-1.0, 1.0, -1.0, 1.0), z=text),
        lambda text: formula_surface((0.0, 1.0, 0.0, 1.0), x="u", y="v", z=text),
    ):
        try:
            read(text)
        except MiurafabError as fault:
            _check_sentence(str(fault), None)


def _quantities(path: Path) -> None:
    for line in path.read_bytes().decode("utf-8", "replace").splitlines():
        _formula(line)
        for parse in (parse_length, parse_angle, parse_feed):
            try:
                parse(line)
            except MiurafabError as fault:
                _check_sentence(str(fault), None)
        for cls, names in (
            (FitOptions, ("facets", "size", "seed", "amplitude", "pieces", "flat_foldable")),
            (LayoutOptions, ("gap", "quantity", "seam_rows", "max_patch", "rotations")),
        ):
            for name in names:
                try:
                    read_options(cls, {name: line})
                except MiurafabError as fault:
                    _check_sentence(str(fault), None)


READERS: dict[str, Callable[[Path], object]] = {
    **dict.fromkeys(("fold", "svg", "dxf", "cp", "opx"), _pattern),
    "objpair": _pair,
    "mesh": _mesh,
    "machine": mf.load_machine,
    "material": mf.load_material,
    "design": mf.design,
    "stock": read_stock,
    "profile": read_profile,
    "image": lambda path: read_image(path, 1.0),
    "gcode": _gcode,
    "hpgl": _gcode,
    "layout": _layout,
    "manifest": lambda path: read_manifest(path.parent),
    "journal": _journal,
    "job": _job,
    "calibration": _calibration,
    "unfinished": _unfinished,
    "dump": read_dump,
    "reply": _replies,
    "order": _order,
    "quantity": _quantities,
}


@dataclass
class Tally:
    """What became of the files of one format."""

    executions: int = 0
    accepted: int = 0
    slowest_s: float = 0.0
    faults: Counter[str] = field(default_factory=Counter)


class _TooSlow(BaseException):
    """Raised by the clock; no reader catches it."""


def fuzz(name: str, count: int, seed: int = 0, keep: Path | None = None) -> Tally:
    """Read ``count`` damaged files of the format ``name``; files at fault go to ``keep``."""
    chance = random.Random(f"{seed} {name}")
    seeds = sorted((CORPUS / name).iterdir())
    contents = [each.read_bytes() for each in seeds]
    tally = Tally()
    before = signal.signal(signal.SIGPROF, _ring)
    try:
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for each in seeds:
                (Path(folder) / each.name).write_bytes(each.read_bytes())
            for _ in range(count):
                at = chance.randrange(len(seeds))
                content = _damaged(contents[at], contents, chance)
                path = Path(folder) / seeds[at].name
                path.write_bytes(content)
                slowest = tally.slowest_s
                fault = _read(READERS[name], path, tally)
                path.write_bytes(contents[at])
                if tally.slowest_s > max(slowest, _LONG_S) and keep is not None:
                    keep.mkdir(exist_ok=True)
                    (keep / f"{name}-slowest{path.suffix}").write_bytes(content)
                if fault is not None:
                    tally.faults[fault] += 1
                    if keep is not None and tally.faults[fault] == 1:
                        keep.mkdir(exist_ok=True)
                        (keep / f"{name}-{len(tally.faults)}{path.suffix}").write_bytes(content)
    finally:
        signal.signal(signal.SIGPROF, before)
    return tally


def _ring(*_: object) -> None:
    raise _TooSlow


def _read(reader: Callable[[Path], object], path: Path, tally: Tally) -> str | None:
    """Read one file; returns what is at fault, None for nothing."""
    tally.executions += 1
    begun = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, SLOW_S)
    try:
        reader(path)
        tally.accepted += 1
    except MiurafabError as fault:
        return _check_sentence(fault.sentence, path)
    except _TooSlow:
        return "it takes longer than 10 s"
    except BaseException as fault:
        if isinstance(fault, KeyboardInterrupt):
            raise
        frame = traceback.extract_tb(fault.__traceback__)[-1]
        ours = [f for f in traceback.extract_tb(fault.__traceback__) if "miurafab" in f.filename]
        place = ours[-1] if ours else frame
        return f"{type(fault).__name__} at {Path(place.filename).name}:{place.lineno}: {fault}"[
            :160
        ]
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        tally.slowest_s = max(tally.slowest_s, time.process_time() - begun)
    return None


def _check_sentence(sentence: str, path: Path | None) -> str | None:
    """What is wrong with the sentence of a refusal, None for nothing."""
    if not is_plain(sentence) or len(sentence) > 2000:
        return f"a sentence for a terminal: {sentence[:80]!r}"
    if path is not None and path.name not in sentence and path.parent.name not in sentence:
        return f"a sentence without the file: {sentence[:80]!r}"
    return None


def _damaged(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    for _ in range(chance.choice((1, 1, 1, 2, 3, 6))):
        content = chance.choice(_DAMAGES)(content, others, chance)
    return content[: 1 << 18]


def _bytes(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.randint(1, 4)):
        if changed:
            changed[chance.randrange(len(changed))] = chance.randrange(256)
    return bytes(changed)


def _number(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """Another number in place of one."""
    at = chance.randrange(len(content) + 1)
    while at < len(content) and not content[at : at + 1].isdigit():
        at += 1
    end = at
    while end < len(content) and content[end : end + 1] in b"0123456789.eE+-":
        end += 1
    return content[:at] + chance.choice(NUMBERS).encode() + content[end:]


def _token(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    at = chance.randrange(len(content) + 1)
    return content[:at] + chance.choice(TOKENS).encode() + content[at:]


def _block(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """A block is removed, doubled, or taken from another file."""
    at, to = sorted(chance.randrange(len(content) + 1) for _ in range(2))
    other = chance.choice(others)
    begin = chance.randrange(len(other) + 1)
    return chance.choice(
        (
            content[:at] + content[to:],
            content[:to] + content[at:to] * chance.randint(1, 3) + content[to:],
            content[:at] + other[begin : begin + to - at] + content[to:],
            content[:at],
        )
    )


def _line(content: bytes, others: list[bytes], chance: random.Random) -> bytes:
    """A line is removed, doubled or moved."""
    lines = content.split(b"\n")
    line = lines.pop(chance.randrange(len(lines)))
    for _ in range(chance.randint(0, 2)):
        lines.insert(chance.randrange(len(lines) + 1), line)
    return b"\n".join(lines)


_DAMAGES = (_bytes, _number, _number, _number, _token, _block, _line)


def main() -> int:
    """Run the fuzzer as the command line says."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", default=list(READERS), metavar="FORMAT")
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    faults = executions = accepted = 0
    print(f"{'format':10} {'read':>8} {'accepted':>9} {'slowest':>8}  faults")
    for name in asked.formats:
        tally = fuzz(name, asked.count, asked.seed, Path("fuzz-found"))
        faults += len(tally.faults)
        executions += tally.executions
        accepted += tally.accepted
        print(
            f"{name:10} {tally.executions:8,} {tally.accepted:9,} {tally.slowest_s:6.2f} s  "
            f"{len(tally.faults)}",
            flush=True,
        )
        for fault, count in tally.faults.most_common():
            print(f"    {count} x {fault}", flush=True)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{executions:,} executions, {accepted:,} accepted, {faults} faults, {peak:,.0f} MB")
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
