"""The tab of the sheets: one's own machines, materials and stock; every file of a job."""

import io
import json
import shlex
import zipfile

import pytest
from studios import Asked, Done, sentence

from miurafab.cli.program import run as run_command
from miurafab.profiles.shipped import own_directory, shipped_directory

CHOSEN = {"machine": "grbl-laser-400", "material": "card-250"}
STOCK = """
[[sheets]]
name = "off-cut"
width = "260mm"
height = "180mm"
quantity = 9
"""


def own(kind, name, change=lambda text: text):
    """A profile of one's own, made of the first shipped one of its kind."""
    home = own_directory(kind)
    home.mkdir(parents=True, exist_ok=True)
    shipped = sorted(shipped_directory(kind).glob("*.toml"))[0]
    (home / f"{name}.toml").write_text(change(shipped.read_text(encoding="utf-8")))


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "configuration"))


def test_own_profiles_are_listed_as_soon_as_they_are_there(tmp_path):
    asked = Asked(tmp_path)
    before = asked.get("catalogue").json()
    assert not any(each["own"] for each in (*before["machines"], *before["materials"]))
    assert before["faults"] == []
    own("firmware_profiles", "my-laser")
    own("materials", "my-card")
    own("materials", "broken", lambda text: text + "\nnothing = 1\n")
    now = asked.get("catalogue").json()
    assert {each["name"] for each in now["machines"] if each["own"]} == {"my-laser"}
    assert {each["name"] for each in now["materials"] if each["own"]} == {"my-card"}
    (fault,) = now["faults"]
    assert "broken.toml" in fault
    assert "nothing" in fault
    wanted = {"machine": "my-laser", "material": "my-card"}
    said = sentence(asked.post("sheets", wanted))
    assert said.startswith("There is no pattern")  # both names were taken
    assert "material of the list" in sentence(asked.post("sheets", wanted | {"material": "none"}))


def test_a_default_that_is_gone_is_told_and_the_page_opens(tmp_path):
    own("firmware_profiles", "my-laser")
    assert run_command(["use", "my-laser", "--quiet"], serve_studio=None) == 0
    asked = Asked(tmp_path)
    assert asked.get("catalogue").json()["machine"] == "my-laser"
    (own_directory("firmware_profiles") / "my-laser.toml").unlink()
    found = asked.get("catalogue").json()
    assert found["machine"] == "grbl-laser-400"
    assert "my-laser" in found["faults"][0]


def test_a_stock_file_is_read_at_once_and_laid_out_on(tmp_path, monkeypatch):
    """The job is that of the command that is shown, byte for byte, with the drawings chosen."""
    (tmp_path / "bench").mkdir()
    asked = Asked(tmp_path / "bench", Done)
    assert asked.fit("hypar", facets="4x4", size="120mm").status == 200
    asked.state()
    for content, said in ((b"[[sheets]]\nname = 3\n", "bad.toml"), (b"x = ", "bad.toml")):
        assert said in sentence(asked.upload("bad.toml", content))
    assert [each for each in asked.state()["sources"] if each["kind"] == "stock"] == []
    assert len(list((tmp_path / "bench").iterdir())) == 1  # nothing of them is left
    stock = asked.upload("my stock.toml", STOCK.encode()).json()["source"]
    order = CHOSEN | {"stock": stock, "formats": "dxf,pdf", "options": {"gap": "3mm"}}
    assert asked.post("sheets", order).status == 200
    job = asked.state()["job"]
    fit, sheets = job["command"].split(" && ")
    assert sheets.endswith("--gap 3mm --stock my-stock.toml --formats dxf,pdf")
    with zipfile.ZipFile(io.BytesIO(asked.get(job["files"]["zip"]).body.read_bytes())) as archive:
        packed = {name: archive.read(name) for name in archive.namelist()}
    layout = json.loads(packed["hypar-job/layout.json"])
    assert {sheet["stock"] for sheet in layout["sheets"]} == {"off-cut"}

    # Every file of it can be had by itself, under its own name, and is the one in the archive.
    assert set(job["every"]) == set(packed)
    assert {"hypar-job/sheet-01.dxf", "hypar-job/sheet-01.svg", "hypar-job/assembly.pdf",
            "hypar-job/assembly.html", "hypar-job/sheet-01.pdf"} <= set(packed)  # fmt: skip
    for name, address in job["every"].items():
        answered = asked.get(f"{address}?save")
        assert answered.status == 200
        assert answered.body.read_bytes() == packed[name]
        assert answered.headers["Content-Disposition"].endswith(name.partition("/")[2])
        assert "sandbox" in answered.headers["Content-Security-Policy"]
    assert asked.get("files/1/../../secret").status == 404

    design = asked.get("design.toml").body.decode()
    assert 'stock = "my-stock.toml"' in design
    (tmp_path / "my-stock.toml").write_text(STOCK)
    monkeypatch.chdir(tmp_path)
    for command in (fit, sheets):
        assert run_command([*shlex.split(command)[1:], "--quiet"], serve_studio=None) == 0
    folder = tmp_path / job["name"]
    made = {f"hypar-job/{path.name}": path.read_bytes() for path in folder.iterdir()}
    told = [json.loads(files.pop("hypar-job/manifest.json")) for files in (packed, made)]
    stocks = [manifest["options"].pop("stock") for manifest in told]
    assert [path.rpartition("/")[2] for path in stocks] == ["my-stock.toml"] * 2
    assert told[0] == told[1]
    assert packed == made


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"stock": "7"}, "choose it again"),
        ({"stock": "/etc/passwd"}, "choose it again"),
        ({"stock": ["1"]}, "text"),
        ({"formats": "dxf,dwg"}, "'dwg' is not a drawing format"),
        ({"formats": "../x"}, "not a drawing format"),
        ({"formats": ["dxf"]}, "text"),
    ],
)
def test_stocks_and_drawings_that_are_none(tmp_path, change, said):
    asked = Asked(tmp_path, Done)
    assert asked.fit("plane", facets="2x2").status == 200
    asked.state()
    assert said in sentence(asked.post("sheets", CHOSEN | change))
    assert len(asked.orders) == 1
