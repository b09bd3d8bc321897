"""Each tab of a job, where it lies, and its mate: recomputed from the written files, and seen."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from flat_patterns import bed, card
from piece_problems import gores
from PIL import Image

import miurafab
from miurafab.fabrication.mates import seam_tabs
from miurafab.fabrication.options import LayoutOptions
from miurafab.fabrication.sheets import lay_out
from miurafab.workflow.page import write_page
from miurafab.workflow.preview import preview


def shells():
    """A cut through a height field, a ring that closes on itself, and two copies of a model."""
    open_shell = miurafab.fit("hypar", facets=(4, 4), size=260).pattern
    ring = miurafab.fit("cylinder", facets=(4, 6), size=120, close="seam").pattern
    yield "cut", open_shell, {"max_patch": "150mmx150mm"}
    yield "ring", ring, {"max_patch": "150mmx150mm"}
    yield "copies", open_shell, {"max_patch": "220mmx220mm", "quantity": 2}


@pytest.fixture(scope="module")
def jobs(tmp_path_factory):
    made = {}
    for name, pattern, options in shells():
        job = miurafab.sheets(pattern, **options)
        folder = tmp_path_factory.mktemp(name) / "job"
        job.write(folder)
        made[name] = job, folder
    return made


def test_a_tab_on_an_open_border_has_no_mate():
    options = LayoutOptions(border_tabs="all")
    layout = lay_out(gores(), bed(400.0, 400.0), card(), options=options)
    tabs = list(seam_tabs(layout, gores()))
    alone = [tab for tab in tabs if tab.mate_mm is None]
    assert len(alone) == layout.totals.border_tabs == 24
    assert len(tabs) == layout.totals.tabs
    every = [tab for patch in layout.patches for tab in patch.tabs]
    assert {tab.number for tab in alone} == {tab.number for tab in every if tab.mate_edge is None}


def turn(degrees):
    angle = np.radians(degrees)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("name", ["cut", "ring", "copies"])
def test_the_mates_are_those_that_the_files_tell(jobs, name):
    """By the formula of the contract alone: R(placement) (R(patch) (p - origin)) + (x, y)."""
    job, folder = jobs[name]
    layout = json.loads((folder / "layout.json").read_text())
    fold = json.loads((folder / layout["pattern"]["file"]).read_text())
    flat = np.array(fold["vertices_coords"])[:, :2]
    folded = np.array(fold["file_frames"][0]["vertices_coords"])
    edges = np.array(fold["edges_vertices"])
    placed = {
        place["patch"]: (sheet["name"], place)
        for sheet in layout["sheets"]
        for place in sheet["placements"]
    }
    patches = {patch["id"]: patch for patch in layout["patches"]}
    told = {(tab.patch, tab.number): tab for tab in seam_tabs(job.layout, job.pattern)}
    count = 0
    for patch in layout["patches"]:
        sheet, place = placed[patch["id"]]
        for tab in patch["tabs"]:
            count += 1
            seen = told[patch["label"], tab["number"]]
            there = np.array(tab["polygon_mm"]) @ turn(place["rotation_deg"]).T
            assert seen.sheet == sheet
            shift = np.array([place["x_mm"], place["y_mm"]])
            assert np.allclose(seen.polygon_mm, there + shift, atol=1e-3)
            if tab["mate_patch"] is None:
                assert seen.mate_mm is None
                continue
            mate = patches[tab["mate_patch"]]
            mate_sheet, other = placed[mate["id"]]
            ends = (flat[edges[tab["mate_edge"]]] - mate["origin_mm"]) @ turn(
                mate["rotation_deg"]
            ).T
            ends = ends @ turn(other["rotation_deg"]).T + (other["x_mm"], other["y_mm"])
            assert (seen.mate_patch, seen.mate_sheet) == (mate["label"], mate_sheet)
            assert np.allclose(seen.mate_mm, ends, atol=1e-3)
            # It is the mate indeed: both edges are one in the folded form.
            own, its = folded[edges[tab["edge"]]], folded[edges[tab["mate_edge"]]]
            apart = min(np.abs(own - its).max(), np.abs(own - its[::-1]).max())
            assert apart < 1e-6
            facets = {tuple(sorted(edges[tab["mate_edge"]]))}
            corners = (fold["faces_vertices"][face] for face in mate["faces"])
            assert any(
                {tuple(sorted(pair)) for pair in zip(face, face[1:] + face[:1], strict=True)}
                & facets
                for face in corners
            )
    assert len(told) == count > 5


def test_a_job_directory_tells_the_same_tabs_and_a_changed_one_none(jobs, tmp_path):
    job, folder = jobs["cut"]
    wanted = [(tab.patch, tab.number, tab.mate_sheet) for tab in preview(job).tabs]
    read = preview(folder).tabs
    assert [(tab.patch, tab.number, tab.mate_sheet) for tab in read] == wanted
    assert len({tab.sheet for tab in read} | {tab.mate_sheet for tab in read}) > 1
    (folder / "layout.json").write_text((folder / "layout.json").read_text() + " ")
    assert preview(folder).tabs == ()


MARK = (0xC4, 0x00, 0x9A)


class Looking(Browser):
    """The page, and what is said on it."""

    def said(self) -> str:
        return str(self.run("document.getElementById('tab-said').value"))

    def key(self, key: str) -> None:
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key)

    def colours(self, x: float, y: float, reach: int) -> set[tuple[int, int, int]]:
        """The colours on the screen around a place."""
        clip = {"x": x - reach, "y": y - reach, "width": 2 * reach, "height": 2 * reach, "scale": 1}
        shot = base64.b64decode(self.call("Page.captureScreenshot", clip=clip)["data"])
        picture = Image.open(io.BytesIO(shot)).convert("RGB")
        return {colour for _, colour in picture.getcolors(1 << 24)}


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_click_on_a_tab_marks_it_and_its_mate_on_both_sheets(jobs, tmp_path: Path) -> None:
    job, _ = jobs["cut"]
    seen = preview(job)
    write_page(tmp_path / "page.html", title="job", preview=seen)
    across = next(tab for tab in seen.tabs if tab.mate_sheet not in ("", tab.sheet))
    with Looking(tmp_path / "profile") as page:
        page.open(tmp_path / "page.html")
        first = [sheet.name for sheet in seen.sheets].index(across.sheet)
        page.run(
            "{ const box = document.getElementById('sheet-choice'); box.value = "
            f"{first}; box.dispatchEvent(new Event('change')); }}"
        )
        assert page.said() == ""
        middle = across.polygon_mm.mean(axis=0)
        x0, y0, x1, y1 = seen.sheets[first].view_mm
        box = page.run(
            "(() => { const b = document.getElementById('sheet-canvas').getBoundingClientRect();"
            "return [b.left, b.top, b.width, b.height]; })()"
        )
        # the view is fitted into the canvas as fit() says: 14 px free, and a ruler of 34 below
        scale = min((box[2] - 28) / (x1 - x0), (box[3] - 62) / (y1 - y0))
        x = box[0] + box[2] / 2 + (middle[0] - (x0 + x1) / 2) * scale
        y = box[1] + box[3] / 2 - (middle[1] - (y0 + y1) / 2) * scale - 17
        assert MARK not in page.colours(x, y, 30)
        for kind in ("mousePressed", "mouseReleased"):
            page.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
        assert MARK in page.colours(x, y, 30)
        told = f"Tab {across.label} of patch {across.patch}, on this sheet, is joined to patch "
        assert page.said() == f"{told}{across.mate_patch}, on {across.mate_sheet}."
        choice = "document.getElementById('sheet-choice').selectedOptions[0].textContent"
        page.run("document.getElementById('tab-mate').click()")
        assert page.run(choice) == across.mate_sheet
        assert page.said().endswith(f"{across.mate_patch}, on this sheet.")
        page.run("document.getElementById('sheet-canvas').focus()")
        page.key("m")
        assert page.run(choice) == across.sheet
        order = [(tab.patch, tab.label) for tab in seen.tabs]
        at = order.index((across.patch, across.label))
        page.key("t")
        following = seen.tabs[(at + 1) % len(order)]
        assert page.said().startswith(f"Tab {following.label} of patch {following.patch}, ")
        assert page.run(choice) == following.sheet
        page.key("T")
        assert page.said().startswith(f"Tab {across.label} of patch {across.patch}, ")
