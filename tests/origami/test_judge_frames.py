"""The further frames of a file are judged: places, lengths, and the order of layers."""

import json
import math

import numpy as np
import pytest

import miurafab as mf
from miurafab.geometry.polygons import edge_lengths
from miurafab.origami.crease_pattern import CreasePattern
from miurafab.origami.folding.layers import known_layer_order
from miurafab.origami.formats.fold import parse_fold
from miurafab.origami.formats.fold_states import FurtherFrame
from miurafab.origami.judge_frames import judge_frames


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    """An exactly flat-foldable sheet, whose last frame is folded flat."""
    path = tmp_path_factory.mktemp("exact") / "exact.fold"
    mf.fit("hypar", facets=(4, 4), flat_foldable="exact").pattern.save(path)
    return json.loads(path.read_text())


def judged(document, tmp_path):
    path = tmp_path / "given.fold"
    path.write_text(json.dumps(document))
    return mf.check(path)


def copied(document):
    """A copy of ``document``, and its frame that is folded flat."""
    found = json.loads(json.dumps(document))
    frame = found["file_frames"][-1]
    assert frame["frame_title"] == "folded flat"
    return found, frame


def test_the_frame_folded_flat_is_proved_wherever_it_lies(document, tmp_path):
    found, frame = copied(document)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    points = np.pad(np.array(frame["vertices_coords"]), ((0, 0), (0, 1)))[:, :3]
    over = points * [1.0, -1.0, -1.0]
    for moved in (points, points @ turn + 5.0, over, over @ turn):
        frame["vertices_coords"] = moved.tolist()
        check = judged(found, tmp_path)
        assert check.valid, check.findings
        assert "Each of the 1 further frames is a state of the sheet." in check.proved


def test_facets_that_run_clockwise_have_their_orders_the_other_way(document, tmp_path):
    found, frame = copied(document)
    found["faces_vertices"][3].reverse()
    frame["faceOrders"] = [[f, g, -s if g == 3 else s] for f, g, s in frame["faceOrders"]]
    assert judged(found, tmp_path).valid


def _moved(frame):
    frame["vertices_coords"][7][0] += 0.01


def _turned(frame):
    f, g, s = frame["faceOrders"][5]
    frame["faceOrders"][5] = [f, g, -s]


def _left_out(frame):
    del frame["faceOrders"][5]


def _strange(frame):
    frame["faceOrders"].append([0, 0, 1])


@pytest.mark.parametrize("change", [_moved, _turned, _left_out, _strange])
def test_a_frame_that_was_changed_is_refused(document, tmp_path, change):
    found, frame = copied(document)
    change(frame)
    check = judged(found, tmp_path)
    assert [finding.code for finding in check.findings if finding.severity == "refusal"] == [
        "frame"
    ]
    assert not any("further frames" in sentence for sentence in check.proved)


@pytest.mark.parametrize("triple", [[0, 99, 1], [0, 1], ["a", 0, 1], [-1, 0, 1]])
def test_an_order_that_is_none_is_one_sentence(document, tmp_path, triple):
    found, frame = copied(document)
    frame["faceOrders"].append(triple)
    with pytest.raises(mf.MiurafabError, match="faceOrders"):
        judged(found, tmp_path)


@pytest.mark.parametrize("orders", [None, np.array([[0, 0, 0]])])
def test_an_edge_may_be_longer_by_a_millionth_of_the_mean_and_no_more(orders):
    """Edges of 3, 4, 0 and 5 mm: between the two corners in one place, a length is exact."""
    flat = np.array([[0, 0], [3, 0], [3, 4], [3, 4.0]])
    ring = np.arange(4)
    pattern = CreasePattern(
        flat, np.stack([ring, np.roll(ring, -1)], 1), np.full(4, "B"), np.zeros(4), ring[None]
    )
    for length, code in ((3e-6, None), (math.nextafter(3e-6, 1), "frame")):
        points = np.pad(flat, ((0, 0), (0, 1)))
        points[3, 2] = length  # across the others
        code = code and ("stretched" if orders is None else code)
        told = list(judge_frames(pattern, [FurtherFrame(4, points, orders)]))
        unjudged = [] if orders is None else ["not-proven"]  # no order in closed form
        assert [each.code for each in told] == ([code] if code else unjudged)
        assert [each.where for each in told if code] == ([(2,)] if code else [])
    points[3, 2], points[0, 0] = 3e-6, -1.0  # two edges are longer, the third is as long as it may
    (told,) = judge_frames(pattern, [FurtherFrame(4, points, orders)])
    assert told.where == (0, 3)
    assert told.sentence.endswith("write the file anew, or take the frame out.")
    (told,) = judge_frames(pattern, [FurtherFrame(n, points, orders) for n in (4, 7)])
    assert told.sentence.startswith("2 of 2 frames are no states of the sheet, and frame 4 is the ")


def test_a_frame_of_a_motion_that_stretches_is_told(document, tmp_path):
    found, _ = copied(document)
    folded = dict(found["file_frames"][0])
    folded["vertices_coords"] = (1.01 * np.array(folded["vertices_coords"])).tolist()
    found["file_frames"].append(folded)
    check = judged(found, tmp_path)
    assert check.valid
    (told,) = (finding for finding in check.findings if finding.code == "stretched")
    assert told.where == tuple(range(len(found["edges_vertices"])))
    assert told.sentence.startswith("Frame 3 is no state of the sheet: 40 of its edges are up to ")


def test_all_frames_that_stretch_are_told_in_one_sentence(document, tmp_path):
    found, _ = copied(document)
    whole = np.array(found["file_frames"][0]["vertices_coords"])
    for size in (1.01, 1.0, 1.03, 1.02):
        frame = dict(found["file_frames"][0], vertices_coords=(size * whole).tolist())
        found["file_frames"].append(frame)
    told = [each for each in judged(found, tmp_path).findings if each.code == "stretched"]
    assert len(told) == 1
    assert told[0].sentence.startswith(
        "3 of 4 frames are no states of the sheet, and frame 5 is the worst: 40 of its edges are "
    )
    assert "take the frames out" in told[0].sentence


def test_a_frame_of_ordered_layers_that_is_not_folded_flat_is_told(document, tmp_path):
    """The folded form itself with the orders of the flat-folded state: all lengths are right."""
    found, frame = copied(document)
    frame["vertices_coords"] = found["file_frames"][0]["vertices_coords"]
    (told,) = (each for each in judged(found, tmp_path).findings if each.code == "frame")
    # How far it is, by the least squares of Kabsch (Acta Cryst. A32, 1976).
    pattern = parse_fold(found)
    there = np.pad(known_layer_order(pattern).folded.vertices, ((0, 0), (0, 1)))
    here = np.array(frame["vertices_coords"])
    here, there = here - here.mean(axis=0), there - there.mean(axis=0)
    u, _, v = np.linalg.svd(here.T @ there)
    moved = here @ u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
    off = np.linalg.norm(moved - there, axis=1).max()
    off /= edge_lengths(pattern.vertices_coords, pattern.edges_vertices).mean()
    assert told.sentence.startswith(
        "Frame 2 orders its facets and is not the sheet folded flat: vertices are up to "
        f"{off:.2g} mean edges off"
    )


def test_pairs_in_another_order_are_named(document, tmp_path):
    found, frame = copied(document)
    orders = frame["faceOrders"]
    one, other = sorted(sorted(pair[:2]) for pair in (orders[2], orders[7]))
    for n in (2, 7):
        f, g, s = orders[n]
        orders[n] = [f, g, -s]
    (told,) = (each for each in judged(found, tmp_path).findings if each.code == "frame")
    first = min(tuple(orders[n][:2]) for n in (2, 7))
    assert told.where == tuple(sorted({*one, *other}))
    assert told.sentence == (
        "Frame 2 has another order of layers than the sheet for 2 pairs of facets, the first being "
        f"{first[0]} and {first[1]}; write the file anew, or take the frame out."
    )
    orders[7] = [orders[7][0], orders[7][1], -orders[7][2]]
    (told,) = (each for each in judged(found, tmp_path).findings if each.code == "frame")
    assert told.where == tuple(sorted(orders[2][:2]))
    assert "than the sheet for 1 pair of facets, the first" in told.sentence


def test_a_frame_that_is_off_says_by_how_much(document, tmp_path):
    found, _ = copied(document)
    folded = found["file_frames"][0]
    points = np.array(folded["vertices_coords"])
    lengths = [
        np.linalg.norm(np.subtract(*np.array(found["vertices_coords"])[[a, b]]))
        for a, b in found["edges_vertices"]
    ]
    points[0, 0] += 1e-3 * np.mean(lengths)
    found["file_frames"].append(dict(folded, vertices_coords=points.tolist()))
    (told,) = (each for each in judged(found, tmp_path).findings if each.code == "stretched")
    beside = [n for n, edge in enumerate(found["edges_vertices"]) if 0 in edge]
    assert set(told.where) <= set(beside)
    flat, moved = lengths, points
    off = max(
        abs(np.linalg.norm(moved[a] - moved[b]) - flat[n])
        for n, (a, b) in enumerate(found["edges_vertices"])
    )
    assert f"are up to {off / np.mean(lengths):.1e} mean edges longer or shorter" in told.sentence
