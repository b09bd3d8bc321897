"""The gallery of the docs is what its commands make."""

import io

import gallery
import numpy as np
from PIL import Image


def test_a_row_and_its_picture_are_made_again():
    entry = next(entry for entry in gallery.ENTRIES if entry.name == "plane")
    row, picture = gallery.made(entry)
    assert row in gallery.PAGE.read_text(encoding="utf-8").splitlines()
    made = np.array(Image.open(io.BytesIO(picture)).convert("RGB"), dtype=float)
    there = np.array(Image.open(gallery.PICTURES / "plane.png").convert("RGB"), dtype=float)
    assert made.shape == there.shape
    assert np.abs(made - there).mean() < 0.5


def test_the_page_shows_every_entry_once():
    page = gallery.PAGE.read_text(encoding="utf-8")
    pictures = {path.stem for path in gallery.PICTURES.glob("*.png")} - {"front"}
    assert pictures == {entry.name for entry in gallery.ENTRIES}
    for entry in gallery.ENTRIES:
        assert page.count(f"`fit {entry.words}`") == 1
