"""The package as a scientist uses it: the calls of INTERFACE.md, names, reprs, wrong kinds."""

from __future__ import annotations

import inspect
import subprocess
import sys
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pytest
import trimesh

import miurafab as mf
from miurafab.errors import MiurafabError
from miurafab.options import declared
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.surfaces.catalogue import CATALOGUE

mpl.use("Agg")


@pytest.fixture(scope="module")
def sheet():
    return mf.fit("hypar", height=0.5, facets=(6, 6), size=120)


@pytest.fixture(scope="module")
def job(sheet):
    return mf.sheets(sheet, machine="grbl-laser-400", material="card-250")


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_the_calls_of_the_interface():
    """As README has them, with fewer facets."""
    sheet = mf.fit("hypar", height=0.5, facets=(8, 8), size=120)
    assert (sheet.status, sheet.advice, sheet.report()["facets"]) == ("converged", "", 64)
    sheet.pattern.save("hypar.fold")
    pattern = mf.load("hypar.fold")
    assert mf.check(pattern).valid
    mf.fold(pattern).save("hypar.gif")
    assert mf.energy(pattern).plot().get_xlabel()
    job = mf.sheets(pattern, machine="grbl-laser-400", material="card-250")
    job.write("jobs/hypar")
    assert mf.preview(job).seconds == mf.preview("jobs/hypar").seconds > 0
    assert mf.cut("jobs/hypar", port="virtual")[0].result.seconds > 60


def test_a_value_and_its_file_say_the_same(sheet, tmp_path):
    sheet.pattern.save(tmp_path / "a.fold")
    for pattern in (sheet, sheet.pattern, tmp_path / "a.fold", str(tmp_path / "a.fold")):
        assert mf.check(pattern).measurements == mf.check(sheet).measurements


TARGETS = {
    "a function": lambda: mf.fit(lambda u, v: 0.3 * u * v, facets=(6, 6)),
    "heights": lambda: mf.fit(
        np.fromfunction(lambda i, j: 2 + i * j / 40, (20, 20)), facets=(6, 6)
    ),
    "a mesh": lambda: mf.fit(trimesh.Trimesh(*_grid(12), process=False), facets=(6, 6), size=150),
}


def _grid(n):
    y, x = np.mgrid[0 : n + 1, 0 : n + 1] / n * 2 - 1
    points = np.stack([x, y, 0.3 * x * y], axis=-1).reshape(-1, 3)
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate(
        [np.stack([a, a + 1, a + n + 2], 1), np.stack([a, a + n + 2, a + n + 1], 1)]
    )
    return points, faces


@pytest.mark.parametrize("kind", TARGETS)
def test_the_file_remembers_the_target(kind):
    sheet = TARGETS[kind]()
    assert sheet.status == "converged"
    sheet.pattern.save("a.fold")
    again = mf.check("a.fold").measurements
    assert again.hausdorff_mm == pytest.approx(sheet.measurements.hausdorff_mm, rel=1e-9)


def test_a_function_is_traded_off_in_other_processes():
    found = mf.tradeoff(lambda u, v: 0.2 * u * v, (4, 6, 8), workers=2)
    assert len(found.found) == 3


def test_the_package_is_light():
    code = (
        "import sys, miurafab; dir(miurafab); "
        "print([m for m in ('numpy', 'scipy', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_is_there_once():
    assert dir(mf) == sorted(mf.__all__)
    assert len(set(mf.__all__)) == len(mf.__all__)
    for name in mf.__all__:
        assert getattr(mf, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'fitt'"):
        _ = mf.fitt


def test_no_parameter_of_a_surface_is_named_like_an_option():
    parameters = {name for entry in CATALOGUE.values() for name in entry.parameters}
    parameters |= {"profile", "domain", "spacing", "height"}
    assert not parameters & set(declared(mf.FitOptions))


@pytest.mark.parametrize(
    ("function", "options"),
    [(mf.fit, mf.FitOptions), (mf.sheets, mf.LayoutOptions), (mf.cut, mf.CutOptions)],
)
def test_help_has_every_option_with_its_unit_and_default(function, options):
    text, parameters = inspect.getdoc(function), inspect.signature(function).parameters
    for name, entry in declared(options).items():
        assert f"\n{name} : {entry.kind.metavar}" in text
        assert entry.default_text in " ".join(text.split())
        assert parameters[name].default == entry.default
    assert "Examples" in text


def test_a_value_is_one_line_and_shows_a_picture(sheet, job):
    folding, energy = mf.fold(sheet, 4), mf.energy(sheet, 4)
    trade = mf.tradeoff("hypar", (4, 5, 6))
    written = job.write("jobs/a")
    values = [
        sheet, sheet.pattern, sheet.measurements, mf.check(sheet), folding, folding.motion, energy,
        energy.path, trade, job, job.layout, written, mf.preview(job), job.dry_runs[0],
        mf.design("hypar"), mf.design("hypar").request, mf.FitOptions(), mf.LayoutOptions(),
        mf.CutOptions(), mf.load_machine("grbl-laser-400"), mf.load_material("card-250"),
        mf.doctor(), *mf.cut(written, port="virtual"),
    ]  # fmt: skip
    for value in values:
        assert "\n" not in repr(value)
        assert len(repr(value)) < 200
        assert value._repr_mimebundle_()["text/plain"] == repr(value)
    for value in (sheet, sheet.pattern, folding, energy, trade, job, written, mf.preview(job)):
        shown = value._repr_mimebundle_()
        assert shown["image/svg+xml"].startswith("<svg")
        assert "<table>" in shown["text/html"]
    assert "<th style='text-align:left'>status</th>" in sheet._repr_mimebundle_()["text/html"]
    assert "<td style='text-align:left'></td>" not in sheet._repr_mimebundle_()["text/html"]


def test_everything_is_plotted(sheet, job):
    assert sheet.plot().name == "3d"
    assert sheet.pattern.plot("flat").collections
    assert mf.fold(sheet, 4).plot().collections
    assert job.plot()[0].collections


@pytest.mark.parametrize("letter", ["F", "U", "J"])
def test_a_plot_names_the_lines_of_every_letter(letter: str) -> None:
    """Those of J were left out."""
    points = np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]])
    pattern = CreasePattern(
        vertices_coords=points,
        edges_vertices=np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]]),
        edges_assignment=np.array([*"BBBB", letter]),
        edges_fold_angle=np.zeros(5),
        faces_vertices=np.array([[0, 1, 2], [0, 2, 3]]),
    )
    drawn = {lines.get_label(): len(lines.get_segments()) for lines in pattern.plot().collections}
    name = {"F": "flat", "U": "unassigned", "J": "join"}[letter]
    assert drawn == {"border": 4, name: 1}
    assert pattern._repr_mimebundle_()["image/svg+xml"].count("stroke-dasharray") == 1


WRONG = {
    "fit(3)": lambda sheet: mf.fit(3),
    "fit(None)": lambda sheet: mf.fit(None),
    "fit(b'')": lambda sheet: mf.fit(b"hypar"),
    "fit(cloud)": lambda sheet: mf.fit(np.zeros((50, 3))),
    "fit(row)": lambda sheet: mf.fit(np.zeros(5)),
    "fit(text array)": lambda sheet: mf.fit([["a", "b"]]),
    "fit(PointCloud)": lambda sheet: mf.fit(trimesh.PointCloud(np.eye(3))),
    "facets": lambda sheet: mf.fit("hypar", facets="a lot"),
    "facets number": lambda sheet: mf.fit("hypar", facets=3),
    "size": lambda sheet: mf.fit("hypar", size=[1]),
    "near miss": lambda sheet: mf.fit("hypar", heigth=0.5),
    "height": lambda sheet: mf.fit("hypar", height="tall"),
    "check(None)": lambda sheet: mf.check(None),
    "check(3)": lambda sheet: mf.check(3),
    "fold(no file)": lambda sheet: mf.fold("nofile.fold"),
    "fold(steps)": lambda sheet: mf.fold(sheet, steps="many"),
    "load(bytes)": lambda sheet: mf.load(b"x"),
    "load(folder)": lambda sheet: mf.load("."),
    "load('')": lambda sheet: mf.load(""),
    "energy(material)": lambda sheet: mf.energy(sheet, material=3),
    "energy(list)": lambda sheet: mf.energy([sheet]),
    "save(3)": lambda sheet: sheet.pattern.save(3),
    "save(ending)": lambda sheet: sheet.pattern.save("a.pdf"),
    "plot(form)": lambda sheet: sheet.plot("round"),
    "convert": lambda sheet: mf.convert(1, 2),
    "tradeoff": lambda sheet: mf.tradeoff("hypar", 3),
    "sheets(machine)": lambda sheet: mf.sheets(sheet, machine=3),
    "sheets(option)": lambda sheet: mf.sheets(sheet, gapp=3),
    "sheets(changed machine)": lambda sheet: mf.sheets(
        sheet, machine=replace(mf.load_machine("grbl-laser-400"), title="Mine")
    ),
    "sheets(changed material)": lambda sheet: mf.sheets(
        sheet, material=replace(mf.load_material("card-250"), kerf_mm=0.3)
    ),
    "preview(3)": lambda sheet: mf.preview(3),
    "preview(pattern)": lambda sheet: mf.preview(sheet),
    "cut(port)": lambda sheet: mf.cut(sheet.pattern, port=5),
    "cut(no port)": lambda sheet: mf.cut(sheet.pattern),
    "cut(3)": lambda sheet: mf.cut(3, port="virtual"),
    "read_job(3)": lambda sheet: mf.read_job(3),
    "load_machine(3)": lambda sheet: mf.load_machine(3),
    "load_material(None)": lambda sheet: mf.load_material([]),
    "thick_panels": lambda sheet: mf.thick_panels(sheet, "thick"),
    "calibrate(3)": lambda sheet: mf.calibrate(3),
}


@pytest.mark.parametrize("call", WRONG)
def test_anything_of_the_wrong_kind_is_one_sentence(call, sheet):
    with pytest.raises(MiurafabError) as refusal:
        WRONG[call](sheet)
    sentence = str(refusal.value)
    assert sentence.endswith(".")
    assert "\n" not in sentence
    assert "--" not in sentence


def test_a_near_miss_is_named():
    with pytest.raises(mf.OptionError, match=r"'heigth' is neither an option.*mean 'height'"):
        mf.fit("hypar", heigth=0.5)
