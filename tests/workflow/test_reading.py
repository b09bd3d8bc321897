"""What is read is data of a stranger: it is read, or refused in one sentence, exit code 2."""

import json
import os
from pathlib import Path
from xml.etree import ElementTree

import pytest
from command_line import sentence
from problems import regular
from small_jobs import write_folder

import miurafab as mf
from miurafab.cli.console import Console
from miurafab.errors import InputError, MiurafabError, shown
from miurafab.files import MOST_TEXT_BYTES, as_path, file_name, read_bytes

FOLD = {
    "vertices_coords": [[0, 0], [1, 0], [1, 1], [0, 1]],
    "edges_vertices": [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]],
    "edges_assignment": ["B", "B", "B", "B", "M"],
    "faces_vertices": [[0, 1, 2], [0, 2, 3]],
}
PROFILE = 'title = "x"\n[bed]\nwidth = '
CASES = {
    "bigint.fold": json.dumps(FOLD).replace("[1, 1]", f"[1, {'9' * 400}]"),
    "digits.fold": json.dumps(FOLD).replace("[1, 1]", f"[1, {'9' * 5000}]"),
    "bigface.fold": json.dumps(FOLD).replace("[0, 2, 3]]", f"[0, 2, {'9' * 400}, 3]]"),
    "scale.fold": json.dumps(FOLD | {"miurafab:scale": 7}).replace("7", "9" * 400),
    "angle.fold": json.dumps(FOLD | {"edges_foldAngle": [0, 0, 0, 0, 7]}).replace("7", "9" * 400),
    "infangle.fold": json.dumps(FOLD | {"edges_foldAngle": [0, 0, 0, 0, float("inf")]}),
    "nested.fold": "[" * 100_000,
    "escape.fold": json.dumps(FOLD | {"miurafab:target": {"mesh": "\x1b]0;owned\x07"}}),
    "surrogate.fold": json.dumps(FOLD | {"miurafab:target": {"surface": "\ud800"}}),
    "vertex.fold": json.dumps(FOLD).replace("[0, 2, 3]]", "[0, 2147483648, 3]]"),
    "target.fold": json.dumps(FOLD | {"miurafab:target": {"surface": "hypar", "at": [[1e400]]}}),
    "far.fold": json.dumps(FOLD).replace("[1, 1]", "[1, 1e300]"),
    "deep.svg": "<svg>" + "<g>" * 3000 + "</g>" * 3000 + "</svg>",
    "rgb.svg": '<svg><line x1="0" y1="0" x2="9" y2="9" stroke="rgb(1e999,0,0)"/></svg>',
    "lw.dxf": "0 SECTION 2 ENTITIES 0 LWPOLYLINE 8 M 10 1.0 10 2.0 20 0.0 0 ENDSEC 0 EOF ".replace(
        " ", "\n"
    ),
    "digits.cp": "1_0 0 0 1 1\n1 ٣ 0 1 1\n",
    "empty.opx": "",
    "two.obj": "v 1 2\nv 3 4\nv 5 6\nf 1 2 3\n",
    "digits.toml": f"facets = {'9' * 5000}\n[target]\nsurface = 'plane'\n",
    "big.toml": f"size = {'9' * 400}\n[target]\nsurface = 'plane'\n",
    "curve.toml": f"[target]\nsurface = 'revolution'\nprofile = [[30, 0], [{'9' * 400}, 9]]\n",
    "deep.toml": "a = " + "[" * 5000 + "]" * 5000,
}
COMMAND = {".toml": ("fit", "-o", "x.fold"), ".obj": ("fit", "-o", "x.fold")}


@pytest.mark.parametrize("name", CASES)
def test_a_hostile_file_is_one_sentence(run, tmp_path, name):
    (tmp_path / name).write_text(CASES[name])
    command, *more = COMMAND.get(Path(name).suffix, ("convert", "x.cp"))
    said = sentence(run(command, name, *more), 2)
    assert name in said
    assert said.isprintable()
    assert not (tmp_path / "x.fold").exists()


def test_a_damaged_image_is_one_sentence(tmp_path):
    """Pillow raises a ``SyntaxError`` for a broken PNG."""
    png = (Path(__file__).parent.parent / "corpus/image/a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(png.replace(b"IDAT", b"[[[["))
    with pytest.raises(MiurafabError, match=r"a\.png cannot be read as an image"):
        mf.design(tmp_path / "a.png", height=1.0)


@pytest.mark.parametrize("option", ["--facets=²x3", "--seed=²", "--facets=100000x100000",
                                    "--amplitude=1e308", "--size=1e300"])  # fmt: skip
def test_a_hostile_option_is_one_sentence(run, option):
    sentence(run("fit", "hypar", option, "-o", "x.fold"), 2)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_pipes_devices_folders_and_large_files_are_refused(run, tmp_path):
    os.mkfifo(tmp_path / "pipe.fold")
    (tmp_path / "zero.nc").symlink_to("/dev/zero")
    (tmp_path / "folder.fold").mkdir()
    with (tmp_path / "large.toml").open("wb") as large:
        large.truncate(MOST_TEXT_BYTES + 1)
    assert "pipe.fold is a pipe or a device" in sentence(run("check", "pipe.fold"), 2)
    assert "zero.nc is a pipe or a device" in sentence(run("preview", "zero.nc"), 2)
    assert "folder.fold is a folder" in sentence(run("convert", "folder.fold", "x.cp"), 2)
    assert "larger than 4 MiB" in sentence(run("fit", "large.toml", "-o", "x.fold"), 2)


def test_a_file_that_grows_is_read_to_the_limit_alone(tmp_path, monkeypatch):
    path = tmp_path / "growing"
    path.write_bytes(b"x" * 100)
    with pytest.raises(InputError, match="growing is larger than 0 MiB"):
        read_bytes(path, InputError, 99)
    assert read_bytes(path, InputError, 100) == b"x" * 100


@pytest.mark.parametrize("name", ["caf\udce9.fold", "a\nb.fold", "a\x1b[2J.fold", "a\u202eb.fold"])
def test_names_that_harm_a_terminal_are_refused(run, tmp_path, name):
    with pytest.raises(InputError, match="control or unreadable letters"):
        as_path(name, "The pattern")
    regular(3, 3).save(tmp_path / "a.fold")
    for words in (("convert", "a.fold", name), ("check", name), ("sheets", "a.fold", "-o", name)):
        assert sentence(run(*words), 2).isprintable()
    assert [path.name for path in tmp_path.iterdir()] == ["a.fold"]


def test_names_beyond_ascii_work(run, tmp_path):
    regular(3, 3).save(tmp_path / "Sättel 鞍😀.fold")
    for ending in (".svg", ".opx", ".obj"):
        assert run("convert", "Sättel 鞍😀.fold", f"Sättel 鞍😀{ending}").returncode == 0


@pytest.mark.parametrize(
    "name", ["../secret", "/etc/passwd", "a/b", "..", "", "a\nb", 3, None, "C:x"]
)
def test_a_name_is_no_path(name):
    with pytest.raises(InputError, match=r"layout\.json names .*, which is not the name of a file"):
        file_name(name, "layout.json")


@pytest.mark.parametrize("key", ["machine", "material", "pattern", "sheet", "back"])
def test_a_job_is_read_from_inside_the_job_alone(run, tmp_path, key):
    """Preview and cut refuse a layout that names a file elsewhere."""
    (tmp_path / "secret.toml").write_text("[x]")
    (tmp_path / "secret.nc").write_text("M5\n")
    job = write_folder(tmp_path / "job")
    layout = json.loads((job / "layout.json").read_text())
    if key == "pattern":
        layout["pattern"]["file"] = "../secret.toml"
    elif key in ("sheet", "back"):
        layout["sheets"][0]["name" if key == "sheet" else key] = "../secret"
    else:
        layout[key] = "../secret"
    (job / "layout.json").write_text(json.dumps(layout))
    for words in (("preview", "job"), ("cut", "job", "--port", "virtual")):
        assert "which is not the name of a file" in sentence(run(*words), 2)


def test_a_comment_names_no_profile_elsewhere(run, tmp_path):
    (tmp_path / "job.nc").write_text("(machine ../secret)\nM5\n")
    assert "not the name of a file" in sentence(run("preview", "job.nc"), 2)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -5, 0, 1e9, "wide", None, True])
def test_a_sheet_has_a_size(run, tmp_path, value):
    job = write_folder(tmp_path / "job")
    layout = json.loads((job / "layout.json").read_text())
    layout["sheets"][0]["width_mm"] = value
    (job / "layout.json").write_text(json.dumps(layout))
    assert "layout.json is not a layout" in sentence(run("preview", "job"), 2)


NO_SHEETS = b'{"schema": "miurafab-layout/1", "machine": "m", "material": "n", "sheets": []}'


@pytest.mark.parametrize("content", [b"\xff\xfe{", b"[" * 100_000, NO_SHEETS])
def test_a_damaged_layout_is_refused_by_cut_and_preview(run, tmp_path, content):
    job = write_folder(tmp_path / "job")
    (job / "layout.json").write_bytes(content)
    for words in (("preview", "job"), ("cut", "job", "--port", "virtual")):
        assert "layout.json" in sentence(run(*words), 2)


def test_what_a_file_says_cannot_command_a_terminal(capsys):
    Console().line("a\x1b[2Jb\x9b\u202ec")
    Console().facts({"name": "\x1b]0;owned\x07"})
    said = capsys.readouterr().out
    assert "\x1b[2J" not in said
    assert "\x07" not in said
    assert shown("a\x1b[2J\n\t") == "a\\x1b[2J\n\t"
    assert str(MiurafabError("a\nb \x00.")) == "a\\nb \\x00."
    assert len(str(MiurafabError("9" * 9999))) < 200


def test_a_title_makes_well_formed_xml(tmp_path):
    pattern = regular(3, 3)
    for ending in (".svg", ".opx"):
        pattern.save(tmp_path / f"a{ending}", title="bell \x07 <b> & \x1b[2J \ud800")
        assert ElementTree.parse(tmp_path / f"a{ending}").getroot() is not None


def test_many_crossing_lines_are_refused_at_once(tmp_path):
    lines = "".join(f'<line x1="{n}" y1="0" x2="{3000 - n}" y2="9"/>' for n in range(3000))
    (tmp_path / "many.svg").write_text(f'<svg stroke="#000">{lines}</svg>')
    with pytest.raises(MiurafabError, match=r"many\.svg: .*cross"):
        mf.load(tmp_path / "many.svg")
