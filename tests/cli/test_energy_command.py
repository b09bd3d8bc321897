"""miurafab energy: what it prints, what it writes, what it refuses."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import sentence
from piece_problems import two_pieces
from problems import regular

from miurafab.cli.energy import _pulled
from miurafab.errors import InputError
from miurafab.origami.energy.plot import energy_table
from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.profiles import load_material
from miurafab.profiles.material import Crease
from miurafab.surfaces.catalogue import make_surface
from miurafab.workflow.energy import energy
from miurafab.workflow.uncut import uncut_shares


@pytest.fixture(scope="module")
def hypar():
    """A hypar of 8 x 8 facets, which does not fold rigidly."""
    return fit(
        FitRequest(surface=make_surface("hypar", {})[0], facets=(8, 8), size_mm=200.0)
    ).pattern


@pytest.fixture
def saved(hypar, tmp_path):
    hypar.save(tmp_path / "hypar.fold")
    return tmp_path / "hypar.fold"


def test_json_tells_the_barrier_and_where_it_is(run, saved, hypar):
    done = run("energy", saved, "--steps", "20", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    answer = json.loads(done.stdout)
    curve = energy(hypar, 20)
    assert answer == json.loads(json.dumps(curve.report()))
    assert answer["converged"]
    assert answer["bistable"]
    assert not answer["rigid"]
    assert answer["energy_unit"] == "k_f L"
    assert answer["barrier"] == curve.barrier >= answer["highest_energy"] > 0
    assert abs(answer["last_angle_deg"]) == pytest.approx(2.5)
    low, high = sorted(abs(state["angle_deg"]) for state in answer["stable_states"])
    assert low == 0 < abs(answer["barrier_angle_deg"]) < high
    assert high == pytest.approx(abs(answer["folded_angle_deg"]))


def test_each_of_several_pieces_has_its_own_numbers(run, tmp_path):
    two_pieces(5, 5, 2).save(tmp_path / "pieces.fold")
    answer = json.loads(run("energy", tmp_path / "pieces.fold", "--steps", "2", "--json").stdout)
    assert [piece["piece"] for piece in answer["pieces"]] == [0, 1]
    assert answer["rigid"] is True
    done = run("energy", tmp_path / "pieces.fold", "--steps", "2", "-o", tmp_path / "energy.csv")
    assert done.returncode == 0
    assert "All pieces fold rigidly" in done.stdout
    assert (tmp_path / "energy.csv").read_text().count("\n") == 1 + 2 * 3


def test_joules_with_a_material(run, saved):
    bare = json.loads(run("energy", saved, "--steps", "10", "--json").stdout)
    card = json.loads(
        run("energy", saved, "--steps", "10", "--material", "card-250", "--json").stdout
    )
    assert card["energy_unit"] == "J"
    assert 0 < card["barrier"] < bare["barrier"]


def test_people_get_a_verdict(run, saved, tmp_path):
    done = run("energy", saved, "--steps", "10")
    assert done.returncode == 0
    assert done.stdout.strip().endswith("a barrier on the way to flat holds the folded form.")
    regular(5, 5).save(tmp_path / "flat.fold")
    done = run("energy", tmp_path / "flat.fold", "--steps", "6", "-o", tmp_path / "flat.png")
    assert "It folds rigidly" in done.stdout


def test_the_table_is_the_curve(run, saved, hypar, tmp_path):
    assert run("energy", saved, "--steps", "12", "-o", tmp_path / "e.csv").returncode == 0
    text = (tmp_path / "e.csv").read_text(encoding="utf-8")
    curve = energy(hypar, 12)
    assert text == energy_table(curve)
    rows = list(csv.DictReader(io.StringIO(text)))
    assert list(rows[0]) == ["step", "angle_deg", "energy_k_f_L", "torque_k_f_L_per_rad"]
    values = np.array([[float(value) for value in row.values()] for row in rows])
    assert values[:, 0].tolist() == list(range(13))
    assert np.radians(values[:, 1]) == pytest.approx(curve.path.drives, rel=1e-14)
    assert values[:, 2].tolist() == curve.path.energies.tolist()
    assert values[:, 3].tolist() == curve.path.loads.tolist()


@pytest.mark.parametrize(("kind", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_plots_are_the_same_every_time(run, saved, hypar, tmp_path, kind, start):
    out = tmp_path / f"e.{kind}"
    assert run("energy", saved, "--steps", "10", "-o", out, "--quiet").returncode == 0
    assert out.read_bytes().startswith(start)
    again = tmp_path / f"again.{kind}"
    energy(hypar, 10).save(again, title="hypar")
    assert out.read_bytes() == again.read_bytes()


def test_a_pull_is_told_in_newtons(run, saved, hypar, tmp_path):
    asked = ["--pull", "corners", "--strain", "0.1", "--cycles", "2", "--steps", "6"]
    done = run("energy", saved, *asked, "--json", "-o", tmp_path / "pull.csv")
    assert (done.returncode, done.stderr) == (0, "")
    answer = json.loads(done.stdout)
    curve = energy(hypar, 6, pull="corners", strain=0.1, cycles=2)
    assert answer == json.loads(json.dumps(curve.report())) | {"file": str(tmp_path / "pull.csv")}
    assert answer["pulled"] == [0, 80]
    assert answer["thickness_mm"] == load_material("card-250").thickness_mm
    assert answer["force_n"] == max(answer["curve"]["force_n"]) > 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "pull.csv").read_text(encoding="utf-8"))))
    assert [float(row["force_n"]) for row in rows] == pytest.approx(answer["curve"]["force_n"])
    top = max(rows, key=lambda row: float(row["extension_mm"]))
    assert float(top["extension_mm"]) == pytest.approx(0.1 * answer["distance_mm"])
    assert {row["way"] for row in rows} == {"out", "back"}
    crossing = [_pulled(answer | {"piercings": n})["Facets that cross"] for n in range(3)]
    assert crossing == ["none", "1 pair", "2 pairs"]
    assert "Contact" not in _pulled(answer)
    assert _pulled(answer | {"contact": True})["Contact"] == "springs keep facets apart"
    done = run("energy", saved, *asked, "-o", tmp_path / "pull.svg")
    assert " N pull it to a strain of 0.1" in done.stdout
    assert (tmp_path / "pull.svg").read_bytes().startswith(b"<?xml")
    named = json.loads(run("energy", saved, *asked[2:], "--pull", "0,80", "--json").stdout)
    assert named["curve"] == answer["curve"]


def test_the_share_that_is_uncut_is_what_dashes_leave(hypar):
    """Card: 1.2 mm of each 2 mm are burnt, and 0.6 mm bridges are left at both ends."""
    material = load_material("card-250")
    shares = uncut_shares(hypar, material)
    lengths = np.linalg.norm(
        np.diff(hypar.vertices_coords[hypar.edges_vertices], axis=1)[:, 0], axis=1
    )
    creases = np.isin(hypar.edges_assignment, ["M", "V"])
    assert (shares[~creases] == 1).all()
    usual = 0.4 + 2 * 0.6 / lengths[creases]
    assert np.abs(shares[creases] - usual).max() <= 2 / lengths[creases].min()
    assert 0.4 < shares[creases].min() <= shares[creases].max() < 0.6
    scored = replace(material, creases={kind: Crease("score") for kind in material.creases})
    assert (uncut_shares(hypar, scored) == 1).all()
    parted = replace(material, creases={kind: Crease("cut") for kind in material.creases})
    assert uncut_shares(hypar, parted)[creases] == pytest.approx(1.2 / lengths[creases])


def test_a_material_without_stiff_creases_cannot_be_pulled(hypar):
    material = replace(load_material("card-250"), folding=None)
    with pytest.raises(InputError, match="how stiff its creases are"):
        energy(hypar, material=material, pull="corners")


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--strain", "0.2"], "--strain is for a sheet that is pulled"),
        (["--pull", "0,1"], "two corners of one facet"),
        (["--pull", "0"], "such as 0,120"),
        (["--pull", "0,99"], "0 to 80"),
        (["--pull", "corners", "--crease", "20"], "leave it out with --pull"),
        (["--pull", "corners", "--crease-ratio", "1"], "--crease-ratio does not go with --pull"),
        (["--pull", "corners", "--strain", "0"], "--strain is 0"),
        (["-o", "e.pdf"], "does not end in one of .png, .svg, .csv"),
        (["-o", "nowhere/e.csv"], "does not exist"),
        (["--steps", "0"], "--steps is 0"),
        (["--crease", "0"], "Edge 0 is not a crease"),
        (["--crease-ratio", "-1"], "--crease-ratio is -1"),
        (["--material", "granite"], "granite"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(run, saved, arguments, part):
    assert part in sentence(run("energy", saved, *arguments), 2)


def test_a_pattern_without_a_folded_form_takes_the_end_of_its_motion(run, tmp_path):
    replace(regular(5, 5), folded_coords=None).save(tmp_path / "flat.fold")
    assert json.loads(run("energy", tmp_path / "flat.fold", "--steps", "4", "--json").stdout)[
        "rigid"
    ]


def test_a_pattern_that_bends_on_its_way_from_flat_needs_a_folded_form(run, tmp_path, hypar):
    replace(hypar, folded_coords=None).save(tmp_path / "flat.fold")
    assert "no folded form" in sentence(run("energy", tmp_path / "flat.fold"), 2)


def test_a_material_without_a_modulus_is_refused(hypar):
    material = replace(load_material("card-250"), modulus_pa=None)
    with pytest.raises(InputError, match="gives no modulus"):
        energy(hypar, material=material)


def test_a_path_that_is_lost_is_exit_1(run, saved):
    done = run("energy", saved, "--steps", "1", "--crease-ratio", "1e5", "--json")
    assert done.returncode == 1
    answer = json.loads(done.stdout)
    assert not answer["converged"]
    assert not answer["bistable"]


def test_a_page_is_written_by_its_ending(run, saved, tmp_path):
    page = tmp_path / "pull.html"
    done = run("energy", saved, "--steps", "2", "--pull", "corners", "--cycles", "1", "-o", page)
    assert done.returncode == 0
    assert '"word":"Pulling"' in page.read_text()
