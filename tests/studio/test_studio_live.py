"""What is answered while a hand drags: the newest question alone, quickly, and by a true sheet."""

import json
import os
import re

import numpy as np
import pytest
from rigs import until
from studios import Asked, Done, Waiting, saddle_obj, sentence

import miurafab
from miurafab.fabrication.sheets import lay_out
from miurafab.origami.fitting.fit import coarse
from miurafab.studio import glance
from miurafab.studio.bed_words import planned
from miurafab.studio.glance import MOST, Glances, _stock
from miurafab.studio.live import Live
from miurafab.workflow import mesh_targets
from miurafab.workflow.report_text import pattern_lines

LAYOUT = {"machine": "grbl-laser-400", "material": "card-250", "options": {}}


def refused(response):
    """The sentence about a question that cannot be asked; it comes as an answer."""
    said = response.json()["said"]
    assert response.status == 200
    assert list(said) == ["error"]
    return said["error"]


class Told:
    """A process that answers when the test says so."""

    def __init__(self, on_line, on_end):
        self.on_line, self.on_end, self.asked, self.stopped = on_line, on_end, [], False

    def send(self, value):
        self.asked.append(value)

    def stop(self):
        self.stopped = True


@pytest.fixture
def begun():
    return []


@pytest.fixture
def live(begun):
    def begin(on_line, on_end):
        begun.append(Told(on_line, on_end))
        return begun[-1]

    return Live(begin)


def test_only_the_newest_question_has_an_answer(live, begun):
    first, second = live.ask({"do": "a"}), live.ask({"do": "b"})
    (process,) = begun
    assert [each["do"] for each in process.asked] == ["a", "b"]
    process.on_line({"number": first, "answer": {"late": True}})
    assert live.answer(first) == {"gone": True}
    assert live.answer(second) == {"wait": True}
    process.on_line({"number": second, "answer": {"it": 1}})
    assert live.answer(second) == live.answer(second) == {"answer": {"it": 1}}


def test_a_process_that_ends_is_an_error_and_the_next_question_starts_one(live, begun):
    number = live.ask({})
    begun[0].on_end("It ended.")
    assert live.answer(number) == {"error": "It ended."}
    number = live.ask({})
    begun[0].on_end("It ended again.")  # the old one has no say any more
    begun[1].on_line({"number": number, "answer": {}})
    assert live.answer(number) == {"answer": {}}
    begun[1].on_end("It has answered.")
    assert live.answer(number) == {"answer": {}}
    live.ask({})
    live.stop()
    assert begun[2].stopped


def test_a_process_that_hangs_is_left_for_a_new_one(live, begun, monkeypatch):
    live.ask({})
    monkeypatch.setattr("miurafab.studio.live.PATIENCE_S", -1.0)
    number = live.ask({"do": "again"})
    assert begun[0].stopped
    assert begun[1].asked == [{"number": number, "do": "again"}]


def coarsely(target, layout=LAYOUT, **options):
    asked = {"do": "coarse", "target": target, "options": options, "layout": layout}
    return Glances().answer(asked, lambda fraction, note: None)


def test_a_coarse_sheet_is_exact_and_told_without_the_slow_figures():
    told = coarsely("hypar", facets="10x10", size="250mm")
    lines = {line["name"]: line for line in told["lines"]}
    assert lines["Flat facets"]["mark"] == lines["Folds from flat paper"]["mark"] == "good"
    assert "With its folds" not in lines
    assert max(told["box_mm"]) == 250.0
    points = np.reshape(told["picture"]["points"], (-1, 3)) / 100
    assert len(points) == 121
    assert np.ptp(points, axis=0) == pytest.approx(told["box_mm"], abs=0.06)
    # the distance of its middle is that of the whole measurement
    request = miurafab.design("hypar", facets=(10, 10), size=250, polish="off").request
    whole, quick = miurafab.fit("hypar", facets=(10, 10), size=250, polish="off"), coarse(request)
    assert quick.measurements.hausdorff_mm is None
    assert quick.deviation_mm == whole.deviation_mm
    assert np.array_equal(quick.pattern.vertices_coords, whole.pattern.vertices_coords)


@pytest.mark.parametrize("size", ["100mm", "bed"])
def test_where_no_sheet_is_found_there_is_no_picture(size):
    told = coarsely("hypar", facets="4x4", size=size, timeout="0.000001")
    assert (told["status"], told["headline"]) == ("stalled", "No sheet was found.")
    assert (told["picture"], told["bed"]) == (None, None)
    assert "ended the search before an exact sheet was found" in told["advice"]


def test_what_is_told_of_the_bed_is_what_a_fit_to_the_bed_finds():
    largest = miurafab.fit("hypar", size="bed", facets=(8, 8), polish="off")
    side = float(np.ptp(largest.pattern.folded_coords, axis=0).max())
    told = coarsely("hypar", facets="8x8", size="100mm")["bed"]
    assert (told["title"], told["mark"]) == ("One sheet, no glue", "good")
    assert told["largest_mm"] == int(side)
    told = coarsely("hypar", facets="8x8", size=f"{side + 5}mm")["bed"]
    assert told["remark"] == f"at {int(side)} mm: one sheet, no glue"
    assert told["mark"] == "more"
    assert max(coarsely("hypar", facets="8x8", size="bed")["box_mm"]) == pytest.approx(
        side, abs=0.1
    )
    sealed = coarsely("cylinder", facets="8x8", close="seam")["bed"]
    assert "at most" in sealed["remark"]  # its border has tabs
    assert coarsely("hypar", None, facets="8x8")["bed"] is None
    assert "At least" in coarsely("hypar", facets="8x8", size="2m")["bed"]["title"]


def test_of_many_facets_fewer_are_shown_in_the_same_proportion():
    told = coarsely("plane", facets="80x20")
    columns, rows = told["facets"]
    assert told["fewer"]
    assert 0.5 * MOST <= columns * rows <= MOST
    assert columns / rows == pytest.approx(4, rel=0.1)
    assert not coarsely("plane", facets="20x20")["fewer"]


def test_a_mesh_is_read_once_for_all_its_sizes(tmp_path, monkeypatch):
    file = tmp_path / "saddle.obj"
    file.write_bytes(saddle_obj())
    read = []
    monkeypatch.setattr(mesh_targets, "load_mesh", lambda *a, _of=mesh_targets.load_mesh, **k: (
        read.append(1), _of(*a, **k))[1])  # fmt: skip
    glances = Glances()
    sizes = []
    for size in ("80mm", "120mm"):
        asked = {"facets": "6x6", "size": size, "holes": "all"}
        given = {"do": "coarse", "target": str(file), "options": asked, "layout": LAYOUT}
        sizes.append(max(glances.answer(given, lambda fraction, note: None)["box_mm"]))
    assert sizes == [80, 120]
    assert len(read) == 1
    given["options"] = {"facets": "6x6", "holes": "small"}
    glances.answer(given, lambda fraction, note: None)
    assert len(read) == 2


def test_a_question_that_is_overtaken_is_left():
    class Over(Exception):
        pass

    def over(fraction, note):
        raise Over

    asked = {"do": "coarse", "target": "hypar", "options": {"facets": "6x6"}, "layout": LAYOUT}
    with pytest.raises(Over):
        Glances().answer(asked, over)


@pytest.fixture
def studio(tmp_path):
    asked = Asked(tmp_path, Done)
    yield asked
    asked.studio.live.stop()


def told_by(studio, route, body):
    """The answer to a question, once it is there."""
    said = studio.post(route, body)
    assert said.status == 200, said
    number = said.json()["number"]
    return until(lambda: _there(studio.get(f"live/{number}").json()["said"]), 60.0)


def _there(said):
    return None if "wait" in said else said


def test_the_page_asks_and_the_process_stays(studio):
    target = {"surface": "plane"}
    for size in ("100mm", "120mm"):
        form = {"target": target, "options": {"facets": "4x4", "size": size}, "layout": LAYOUT}
        said = told_by(studio, "live", form)
        assert max(said["answer"]["box_mm"]) == float(size[:-2])
    process = studio.studio.live._process._process
    assert os.getpriority(os.PRIO_PROCESS, process.pid) >= 10
    assert studio.state()["pattern"] is None  # nothing of it lies on the bench
    wrong = {"machine": "grbl-laser-400", "material": "card-250", "options": {"gap": "wide"}}
    said = told_by(studio, "live", form | {"layout": wrong})
    assert said["answer"]["bed"] is None
    said = told_by(studio, "live", {"target": target, "options": {"min_edge": "9m"}})
    assert "asked for" in said["answer"]["advice"]
    assert "`" not in said["answer"]["advice"]  # fields are named as the page names them
    assert studio.studio.live._process._process is process
    assert "'Facets' is '8x'" in refused(
        studio.post("live", {"target": target, "options": {"facets": "8x"}})
    )
    assert "gone" in refused(studio.post("live", {"target": {"source": "9"}}))
    assert sentence(studio.get("live/x"), 404)

    assert "no pattern" in refused(studio.post("live/plan", {"layout": LAYOUT}))
    studio.fit("plane", "4x4", size="420mm")
    said = told_by(studio, "live/plan", {"layout": LAYOUT})["answer"]["bed"]
    pattern = miurafab.fit("plane", facets="4x4", size="420mm").pattern
    totals = lay_out(pattern, *_stock(LAYOUT)[:2]).totals
    glue = f"{totals.seam_mm / 1000:.2f} m of glue"
    assert said["title"] == f"{totals.sheets} sheets, {glue}"
    assert f"{totals.patches} patches" in said["remark"]


def test_another_size_alone_is_the_whole_sheet_scaled(studio):
    studio.fit("hypar", "6x6", size="120mm")
    order = {"target": {"surface": "hypar", "parameters": {}}}

    def way(**options):
        studio.state()  # takes the news in
        body = order | {"options": options, "layout": LAYOUT}
        return studio.studio._question("", json.dumps(body).encode())

    question = way(facets="6x6", size="150mm")
    told = Glances().answer(question, lambda fraction, note: None)
    made = miurafab.fit("hypar", facets="6x6", size="150mm")
    anew = {line["name"]: line["value"] for line in pattern_lines(made.report())}
    scaled = {line["name"]: line["value"] for line in told["lines"]}
    assert set(anew) - set(scaled) == {"Computed in"}
    exact = {name: value for name, value in anew.items() if name != "Computed in"}
    assert scaled == exact
    assert max(told["box_mm"]) == 150
    made_bed = planned(made.pattern, *_stock(LAYOUT))
    assert told["bed"]["largest_mm"] == made_bed["largest_mm"]
    for other in ({"min_edge": "1mm"}, {"facets": "6x8"}, {"size": "bed"}, {"amplitude": "1"}):
        assert way(**({"facets": "6x6", "size": "150mm"} | other))["do"] == "coarse"
    studio.fit("plane", "4x4", min_edge="900mm")  # misses its limit
    order = {"target": {"surface": "plane", "parameters": {}}}
    assert way(facets="4x4", size="150mm")["do"] == "coarse"


def test_the_drawing_on_the_bed_lies_within_the_sheet_just_as_long_as_it_fits():
    largest = coarsely("hypar", facets="8x8")["bed"]["largest_mm"]
    for size, inside in ((largest, True), (largest + 4, False)):
        bed = coarsely("hypar", facets="8x8", size=f"{size}mm")["bed"]
        border = np.reshape(bed["border"], (-1, 2))
        assert len(border) == 2 * 32
        within = (np.ptp(border, axis=0) <= np.array(bed["sheet"]) + 0.2).all()
        assert within == inside
        # turned and moved, nothing else: as long as the border of a fit
        lengths = np.linalg.norm(border[::2] - border[1::2], axis=1)
        made = miurafab.fit("hypar", facets="8x8", size=size, polish="off").pattern
        edges = made.edges_vertices[made.edges_assignment == "B"]
        ends = made.vertices_coords[edges]
        assert lengths == pytest.approx(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1), abs=0.2)


def test_several_pieces_are_not_drawn_on_a_sheet_where_they_will_not_lie():
    bed = coarsely("hypar", facets="8x8", pieces="3")["bed"]
    assert (bed["sheet"], bed["border"]) == (None, [])
    assert bed["largest_mm"] > 0


def test_the_lines_of_the_flat_picture_are_wide_enough_for_its_place_on_the_page(studio):
    studio.fit("plane", "8x8")
    picture = studio.get(studio.state()["pattern"]["files"]["picture"]).body.read_text()
    width = float(re.search(r'width="([0-9.]+)"', picture).group(1))
    lines = [float(each) for each in re.findall(r'stroke-width="([0-9.]+)"', picture)]
    assert min(lines) * 285 / width > 0.5  # pixels, beside the folding at 1280


def test_a_result_says_what_it_is_a_result_of(studio):
    studio.fit("plane", "4x4", size="120mm")
    pattern = studio.state()["pattern"]
    assert pattern["subject"] == "plane · Facets 4x4 · Size 120mm"
    form = {"target": {"surface": "plane", "parameters": {}}}
    assert pattern["form"] == form | {"options": {"facets": "4x4", "size": "120mm"}}
    studio.running = Waiting  # the next one does not end
    studio.fit("plane", "6x6")
    state = studio.state()
    assert state["pattern"]["form"]["options"]["facets"] == "4x4"
    assert state["task"]["form"]["options"]["facets"] == "6x6"


def test_a_fit_takes_the_place_of_the_one_that_it_replaces_and_of_no_other(tmp_path):
    asked = Asked(tmp_path)
    asked.fit("hypar")
    task = asked.state()["task"]["id"]
    order = {"target": {"surface": "plane"}, "options": {}}
    assert "already" in sentence(asked.post("fit", order | {"replaces": "77"}))
    sentence(asked.post("fit", {"target": {"source": "9"}, "replaces": task}))
    assert not asked.orders[0].stopped  # what is refused ends nothing
    assert asked.post("fit", order | {"replaces": task}).status == 200
    assert asked.orders[0].stopped
    assert asked.state()["task"]["running"]
    # news of the first comes too late
    asked.orders[0].coming = [{"part": "pattern", "report": {}, "files": {}}]
    assert asked.state()["pattern"] is None


def test_the_drawing_has_each_facet_once():
    pattern = miurafab.fit("plane", facets="4x4").pattern
    drawn = glance.picture(pattern)
    assert [len(face) for face in drawn["faces"]] == [4] * 16
    assert sorted({at for face in drawn["faces"] for at in face}) == list(range(25))
