"""34 calls that a newcomer writes first: each works, or answers in one sentence."""

from __future__ import annotations

import math
from pathlib import Path

import matplotlib as mpl
import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from PIL import Image

import miurafab as mf

mpl.use("Agg")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first")
    sheet = mf.fit("hypar", facets=(6, 6), size=120)
    sheet.pattern.save(folder / "hypar.fold")
    mf.sheets(sheet).write(folder / "job")
    shades = np.add.outer(np.arange(24) ** 2, np.arange(24) ** 2) / 5
    Image.fromarray(shades.astype(np.uint8)).save(folder / "dem.png")
    (folder / "mine.toml").write_text('facets = "6x6"\n[target]\nsurface = "saddle"\n')
    return folder


WORKS = {
    "1 a name": lambda: mf.fit("hypar", facets=(6, 6)),
    "2 a name with a parameter": lambda: mf.fit("hypar:height=0.4", facets="6x6"),
    "3 a size with a unit": lambda: mf.fit("plane", facets=(4, 4), size="5in"),
    "4 NumPy numbers": lambda: mf.fit("plane", facets=np.array([4, 4]), size=np.float32(90)),
    "5 an angle in degrees": lambda: mf.fit("sphere", width=60, facets=(6, 6)),
    "6 a design file": lambda: mf.fit("mine.toml"),
    "7 a design with an option": lambda: mf.fit("mine.toml", size=90),
    "8 a design in hand": lambda: mf.fit(mf.design("plane", facets=(4, 4)), size=100),
    "9 a function of arrays": lambda: mf.fit(lambda u, v: (u, v, np.cos(u) / 4), facets=(6, 6)),
    "10 a function of numbers": lambda: mf.fit(lambda x, y: math.cos(x) / 4, facets=(6, 6)),
    "11 an image": lambda: mf.fit("dem.png", height=6, facets=(6, 6)),
    "12 load by text": lambda: mf.load("hypar.fold"),
    "13 load by path": lambda: mf.load(Path("hypar.fold")),
    "14 check a file": lambda: mf.check("hypar.fold"),
    "15 save a drawing": lambda: mf.load("hypar.fold").save("hypar.svg"),
    "16 fold a file": lambda: mf.fold("hypar.fold", steps=4).save("hypar.glb"),
    "17 energy of a file": lambda: mf.energy("hypar.fold", 6).save("hypar.png"),
    "18 convert": lambda: mf.convert("hypar.fold", "hypar.dxf"),
    "19 sheets of a file": lambda: mf.sheets("hypar.fold", gap=3).write("jobs/a"),
    "20 preview a folder": lambda: mf.preview("job").write("shown"),
    "21 cut a folder": lambda: mf.cut("job", port="virtual"),
    "22 the lists": lambda: (mf.list_surfaces(), mf.list_machines(), mf.list_materials()),
}
ANSWERS = {
    "23 a misspelt surface": (lambda: mf.fit("hyper"), "did you mean 'hypar'"),
    "24 a misspelt option": (lambda: mf.fit("hypar", facet=(6, 6)), "did you mean 'facets'"),
    "25 a file that is not there": (lambda: mf.load("none.fold"), "does not exist"),
    "26 a design that is not there": (lambda: mf.fit(Path("none.toml")), "'none.toml' is not"),
    "27 a number for a material": (lambda: mf.sheets("hypar.fold", material=3), "is not a path"),
    "28 a pattern to convert": (
        lambda: mf.convert(mf.load("hypar.fold"), "b.svg"),
        "which is not a path",
    ),
    "29 no port": (lambda: mf.cut("job"), "'port' is missing; name the machine's, or 'virtual'"),
    "30 a misspelt port": (lambda: mf.cut("job", prt="x"), "'prt' is not an option; did you mean"),
    "31 a misspelt option of a verb": (
        lambda: mf.fold("hypar.fold", stepss=3),
        "'stepss' is not an option; did you mean 'steps'",
    ),
    "32 a value too many": (
        lambda: mf.fold("hypar.fold", 3, 4),
        "takes pattern and steps without a name, and the rest by name: too many",
    ),
    "33 half a pair": (lambda: mf.fit("hypar", facets="8x"), "is '8x'; write COLSxROWS such as"),
    "34 a tolerance of nothing": (
        lambda: mf.convert("hypar.fold", "b.svg", tolerance=0),
        "'tolerance' is 0",
    ),
}


@pytest.mark.parametrize("call", WORKS)
def test_a_first_call_works(call, folder, monkeypatch):
    monkeypatch.chdir(folder)
    done = WORKS[call]()
    if isinstance(done, mf.FitResult):
        assert done.status == "converged", done.advice


@pytest.mark.parametrize("call", ANSWERS)
def test_a_first_mistake_is_answered(call, folder, monkeypatch):
    monkeypatch.chdir(folder)
    mistake, words = ANSWERS[call]
    with pytest.raises(mf.MiurafabError, match=words):
        mistake()


CELLS = (
    "import miurafab as mf\nsheet = mf.fit('hypar', facets=(6, 6), size=120)\nsheet",
    "mf.sheets(sheet)",
    "mf.energy(sheet, 6)",
    "%matplotlib inline\nsheet.pattern.plot('flat');",
)


def test_a_notebook_shows_pictures(tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in CELLS])
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": tmp_path}}).execute()
    shown = [
        {kind for output in cell.outputs for kind in output.get("data", {})}
        for cell in notebook.cells
    ]
    for kinds in shown[:3]:
        assert {"image/svg+xml", "text/html", "text/plain"} <= kinds
    assert "image/png" in shown[3]
