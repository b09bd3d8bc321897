"""What commands print of a pattern for a person says what their JSON says."""

import json
import math
import re

import named_patterns

from miurafab.origami.formats.fold import write_fold

LIMITS = ("--facets", "4x4", "--size", "150mm", "--max-aspect", "1.5")


def _rows(text):
    """The rows of the table by their names; a row that goes on under itself is one."""
    joined = re.sub(r" *\n {20,}", " ", text)
    found = re.findall(r"^ (\S(?: ?\S)*) {2,}(.*\S) *$", joined, re.MULTILINE)
    return dict(found)


def test_a_fit_and_its_check_say_in_words_what_the_report_has(run, tmp_path):
    fitted = run("fit", "hypar", *LIMITS, "-o", "h.fold", "--report", "h.json")
    assert fitted.returncode == 0, fitted.stderr
    report = json.loads((tmp_path / "h.json").read_text())
    assert fitted.stdout.startswith("The sheet fits and folds from flat paper.\n")
    rows, quality = _rows(fitted.stdout), report["quality"]
    far = f"{report['hausdorff_mm']:.3g} mm at most"
    middle = f"{report['hausdorff_midsurface_mm']:.3g} mm at most"
    held = "; ".join(
        f"limit of {name}, {count} times" for name, count in report["active_bounds"].items()
    )
    share = f"{100 * report['hausdorff_relative']:.1f} % of the size"
    assert rows == {
        "Off the target": f"{middle} (the sheet's middle)",
        "With its folds": f"{far} (tips and grooves, {share})",
        "Flat facets": f"exact ({report['max_planarity']:.0e})",
        "Folds from flat paper": f"exact ({report['max_developability']:.0e})",
        "Same lengths flat and folded": f"exact ({report['max_isometry']:.0e})",
        "Folds flat": f"no ({math.degrees(report['max_flat_foldability']):.2g}° off at the worst "
        "vertex)",
        "Crossings when folded": "none",
        "Overlaps when flat": "none",
        "Shortest edge": f"{report['min_edge_mm']:.3g} mm",
        "Paper": f"{report['area_ratio']:.2f} times the target's area",
        "Facets": "16 (25 vertices)",
        "Covers": f"{100 * report['coverage']:.1f} % of the target",
        "Median edge": f"{quality['edge_mm'][1]:.3g} mm",
        "Sector angles": "{:.1f}° to {:.1f}°".format(*quality["sector_angle_deg"]),
        "Fold angles": "up to {2:.0f}° (median {0:.0f}°)".format(*quality["fold_angle_deg"]),
        "Facet shapes": f"up to {quality['facet_aspect']:.2f} times as long as wide",
        "Held back by": held,
        "Computed in": f"{report['seconds']:.1f} s",
        "File": "h.fold",
    }
    checked = run("check", "h.fold")
    assert checked.stdout.startswith("This pattern is sound.\n")
    again = _rows(checked.stdout)
    exact = ("Flat facets", "Folds from flat paper", "Same lengths flat and folded")
    apart = {"Computed in", "File", "Held back by", *exact}
    assert {k: v for k, v in again.items() if k not in apart} == {
        k: v for k, v in rows.items() if k not in apart
    }
    assert all(again[name].startswith("exact (") for name in exact)


def test_a_fit_that_misses_a_limit_says_so_before_its_figures(run):
    asked = ("--facets", "4x4", "--polish", "off", "--max-distance", "1mm", "-o", "h.fold")
    missed = run("fit", "hypar", *asked)
    assert missed.returncode == 1
    first, second = missed.stdout.splitlines()[:2]
    assert first == "A sheet was found, but it is not valid."
    assert "1 mm" in second
    assert _rows(missed.stdout)["File"] == "h.rejected.fold"


def test_a_pattern_with_faults_says_so_and_each_fault_once(run, tmp_path):
    assert run("fit", "plane", "--facets", "2x2", "-o", "p.fold").returncode == 0
    data = json.loads((tmp_path / "p.fold").read_text())
    data["edges_vertices"].append(data["edges_vertices"][0])
    for name in ("edges_assignment", "edges_foldAngle"):
        data[name].append(data[name][0])
    (tmp_path / "twice.fold").write_text(json.dumps(data))
    checked = run("check", "twice.fold")
    assert checked.returncode == 1
    assert checked.stdout.startswith("This pattern has faults.\n")
    assert checked.stdout.count("join the same two vertices") == 1


def _both(run, *words):
    """The rows for a person, and the JSON, of one command."""
    return _rows(run(*words).stdout), json.loads(run(*words, "--json").stdout)


def test_a_motion_is_told_with_names_and_units(run, tmp_path):
    write_fold(named_patterns.waterbomb_base(), tmp_path / "flat.fold", "flat")
    rows, report = _both(run, "fold", "flat.fold", "--steps", "6")
    assert rows == {
        "Motion": f"{report['motion']}, from flat",
        "Folds rigidly": "yes",
        "Largest strain": f"{report['max_strain']:.1e} of a side or diagonal",
        "Fold angles": f"{report['angle_error_deg']:.1f}° from those asked for, in the mean",
        "Wrong signs": "0 % of the creases",
        "Stable": "in every frame",
        "Snaps": "0",
        "Contact": "none to keep apart",
        "Frames": "7",
        "Passes through itself": "never",
    }
    assert report["rigid"] is True


def test_energy_and_force_are_told_with_their_units(run, tmp_path):
    made = ("plane", "--facets", "4x4", "--size", "60mm", "--flat-foldable", "exact")
    assert run("fit", *made, "-o", "p.fold").returncode == 0
    rows, report = _both(run, "energy", "p.fold", "--steps", "3", "--material", "card-250")
    assert rows["Stiffness"].endswith(" J per rad²")
    assert rows["Driven crease"] == (
        f"{report['crease']}, from {report['folded_angle_deg']:.1f}° to "
        f"{report['last_angle_deg']:.1f}° in {report['steps']} steps"
    )
    assert rows["Folds rigidly"] == "yes"
    rows, report = _both(run, "energy", "p.fold", "--pull", "corners", "--steps", "3")
    one, other = report["pulled"]
    apart = f"{report['distance_mm']:.1f} mm apart, by {100 * report['strain']:.3g} %"
    assert rows["Pulled"] == f"vertices {one} and {other}, {apart}"
    assert rows["Force"].startswith(f"{report['force_n']:.3g} N, ")
    assert rows["Material"].startswith(f"{report['thickness_mm']:.3g} mm thick, modulus ")
    lost = run("energy", "p.fold", "--pull", "corners", "--steps", "3", "--strain", "2")
    assert lost.returncode == 1, lost.stderr
    reached = float(re.search(r"lost at a strain of ([\d.e+-]+),", lost.stdout)[1])
    found = _rows(lost.stdout)
    assert found["Pulled"].endswith(f" by {100 * reached:.3g} %")
    assert "Stays longer by" not in found
    layers, order = _both(run, "layers", "p.fold")
    assert layers["Layers have an order"] == "yes"
    assert layers["Overlapping pairs"] == str(order["pairs"])
    assert layers["Folded flat"] == f"to {order['flat_mismatch']:.1e} of the mean edge"
