"""The pictures of the tutorial are what its script makes."""

import io

import numpy as np
import tutorial_pictures
from PIL import Image


def test_the_pictures_are_made_again():
    made = dict(tutorial_pictures.pictures(tutorial_pictures.fitted()))
    assert set(made) == {path.name for path in tutorial_pictures.FOLDER.glob("*.png")}
    for name, content in made.items():
        new = np.array(Image.open(io.BytesIO(content)).convert("RGB"), dtype=float)
        old = np.array(Image.open(tutorial_pictures.FOLDER / name).convert("RGB"), dtype=float)
        assert new.shape == old.shape
        assert np.abs(new - old).mean() < 0.5, name


def test_the_tutorial_shows_them_and_fits_the_same():
    page = (tutorial_pictures.FOLDER.parent / "tutorial.md").read_text(encoding="utf-8")
    columns, rows = tutorial_pictures.FACETS
    command = f"--facets {columns}x{rows} --size {tutorial_pictures.SIZE_MM:g}mm"
    assert f"miurafab fit patterns/saddle.stl {command} -o saddle.fold" in page
    for path in tutorial_pictures.FOLDER.glob("*.png"):
        assert f"](tutorial/{path.name})" in page
