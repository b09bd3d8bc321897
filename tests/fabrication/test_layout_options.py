"""What may be asked of a layout, from a file or the command line."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from miurafab.errors import InputError, ProfileError
from miurafab.fabrication.options import LayoutOptions, NestingOptions
from miurafab.profiles import load_material, shipped_directory
from miurafab.profiles.material import Crease, Perforation
from miurafab.workflow.sheets import layout_options


def options_of(given, file=None):
    return layout_options(given, file)[0]


def test_nothing_asked_is_the_usual():
    assert options_of({}) == LayoutOptions()


def test_every_option_is_read():
    options = options_of(
        {
            "gap": "3mm",
            "offcuts": "200x300mm, 15cm x 100",
            "max_patch": "10cm x 300",
            "prefer": "glue",
            "seam_rows": "7, 3",
            "seam_columns": 4,
            "open_row": 5,
            "open_column": 6,
            "tab_height": "5mm",
            "tab_inset": "0.5mm",
            "tab_angle": "60deg",
            "tab_side": "alternate",
            "full_facet": True,
            "two_sided": True,
            "bridges": 3,
            "bridge": "0.4mm",
            "spread_heat": True,
            "quantity": 3,
            "stock": "my/stock.toml",
            "margin": "8mm",
            "grain": "y",
            "along_grain": "y",
            "rotations": "180, 0",
        }
    )
    assert options == LayoutOptions(
        gap_mm=3.0,
        offcuts_mm=((300.0, 200.0), (150.0, 100.0)),
        max_patch_mm=(300.0, 100.0),
        prefer="glue",
        seam_rows=(3, 7),
        seam_columns=(4,),
        open_row=5,
        open_column=6,
        tab_height_mm=5.0,
        tab_inset_mm=0.5,
        tab_angle=math.radians(60),
        tab_side="alternate",
        full_facet=True,
        two_sided=True,
        bridges=3,
        bridge_mm=0.4,
        spread_heat=True,
        nesting=NestingOptions(
            quantity=3,
            stock=Path("my/stock.toml"),
            margin_mm=8.0,
            grain="y",
            along_grain="y",
            rotations=(0, 180),
        ),
    )


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"gapp": "2mm"}, "'gapp' is not an option; did you mean 'gap'"),
        ({"max_patch": "300mm"}, "'max_patch' is '300mm'; write LENGTHxLENGTH such as 300mmx200mm"),
        ({"offcuts": "300x200,"}, "'offcuts' is '300x200,', of which a part is ''; write LENGTHx"),
        ({"max_patch": "300mm x 0"}, "a part is 0 mm; it must be greater than 0 mm"),
        ({"seam_rows": "0"}, "'seam_rows' is '0', of which a part is 0; it must be between 1 and"),
        ({"open_row": 0}, "'open_row' is 0; it must be between 1 and"),
        ({"tab_side": "left"}, "it must be one of lower, upper, alternate"),
        ({"quantity": 0}, "'quantity' is 0; it must be between 1 and 1000"),
        ({"rotations": "0,360"}, "a part is 360; it must be between 0 and 359"),
        ({"bridges": 1}, "'bridges' is 1, on which a piece would swing"),
        ({"tab_angle": 200}, "'tab_angle' is 200 deg; it must be between 5 deg and 180 deg"),
        ({"bridge": "1mm"}, "'bridge' is the length of holding bridges, but none are wanted"),
    ],
)
def test_a_wrong_option_is_refused_by_name(given, complaint):
    with pytest.raises(InputError, match=complaint):
        options_of(given)


def test_options_of_a_design_file_give_way_to_those_of_the_command_line(tmp_path):
    file = tmp_path / "x.toml"
    file.write_text('[layout]\nmachine = "m"\ngap = "4mm"\nbridges = 2\nstock = "s.toml"\n')
    options = options_of({"gap": "1mm"}, file)
    beside = NestingOptions(stock=tmp_path / "s.toml")
    assert options == LayoutOptions(gap_mm=1.0, bridges=2, nesting=beside)
    own = options_of({"stock": "mine.toml"}, file)
    assert own.nesting.stock == Path("mine.toml")


def with_creases(tmp_path, text, perforation=""):
    whole = (shipped_directory("materials") / "card-250.toml").read_text()
    whole = whole.replace("[perforation]", f"[perforation]\n{perforation}")
    file = tmp_path / "own.toml"
    file.write_text(f"{whole}\n{text}")
    return load_material(file)


def test_a_material_says_how_each_kind_of_crease_is_made(tmp_path):
    material = with_creases(
        tmp_path,
        '[creases]\nrelief_hole = "0.5mm"\n'
        '[creases.valley]\nmode = "score"\n'
        '[creases.tab]\ncut = "2mm"\nfit = "stretch_gap"\n',
        'start_end = "cut"',
    )
    assert material.relief_hole_mm == 0.5
    usual = Perforation(1.2, 0.8, 0.6, 0.5, start_end="cut")
    assert material.perforation == usual
    own = Perforation(2.0, 0.8, 0.6, 0.5, start_end="cut", fit="stretch_gap")
    assert material.creases == {
        "mountain": Crease(),
        "valley": Crease("score"),
        "tab": Crease("perforate", own),
    }
    assert material.perforation_of("tab") == own
    assert material.perforation_of("mountain") == usual


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            '[creases.mountin]\nmode = "cut"',
            "'mountin' is not a known key",
        ),
        ('[creases.valley]\nmode = "burn"', "it must be one of perforate, score, cut, none"),
        ('[creases.valley]\nmode = "cut"\nend_bridge = 0', "would part the sheet"),
        ('[creases]\nrelief_hole = "0.2mm"', "it must be 0 or at least 0.25 mm"),
    ],
)
def test_a_wrong_crease_table_is_refused_by_name(tmp_path, text, complaint):
    with pytest.raises(ProfileError, match=complaint):
        with_creases(tmp_path, text)
