"""The gallery of the docs is what its commands make."""

import io
import re

import gallery
import numpy as np
from PIL import Image

import miurafab as mf

PAGE = gallery.PAGE.read_text(encoding="utf-8")


def line(row):
    return f"| {' | '.join(row)} |"


def test_a_row_and_its_picture_are_made_again():
    """To the last bit here; a pixel on an edge may differ on another kind of processor."""
    entry = next(entry for entry in gallery.ENTRIES if entry.name == "cylinder")
    row, picture = gallery.made(entry)
    assert line(row) in PAGE.splitlines()
    made = np.array(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    there = np.array(Image.open(gallery.PICTURES / "cylinder.png").convert("RGB"), dtype=float)
    assert made.shape == there.shape
    assert (np.abs(made - there).max(axis=2) > 16).sum() < 20


def test_a_design_is_made_again():
    entry = next(entry for entry in gallery.DESIGNS if entry.name == "hypar")
    assert line(gallery.design_row(entry)) in PAGE.splitlines()


def test_the_page_shows_every_entry_once():
    pictures = {path.stem for path in gallery.PICTURES.glob("*.png")} - {"front"}
    assert pictures == {entry.name for entry in gallery.ENTRIES}
    for entry in (*gallery.ENTRIES, *gallery.DESIGNS):
        assert PAGE.count(f"`fit {entry.words}`") == 1


def test_it_has_every_named_surface():
    shown = {re.split("[ :]", entry.words)[0] for entry in gallery.ENTRIES}
    assert set(mf.list_surfaces()) <= shown


def test_on_the_site_each_figure_has_the_name_of_its_column():
    """There the heads of the columns are not shown."""
    style = (gallery.PAGE.parent / "site.css").read_text(encoding="utf-8")
    named = dict(re.findall(r"nth-child\((\d)\)::before { content: \"(.*): \"; }", style))
    assert named == {str(place): name for place, name in enumerate(gallery.HEAD, 1) if place > 2}
