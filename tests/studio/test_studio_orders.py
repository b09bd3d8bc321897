"""What the page may ask for, and the same as command lines and design files."""

import json
import shlex
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.errors import InputError
from miurafab.fabrication.options import LayoutOptions
from miurafab.options import File, read_options
from miurafab.studio.form import FIT, LAYOUT
from miurafab.studio.orders import read_fit, read_layout, read_source
from miurafab.studio.recipe import design_text, fit_command, sheets_command
from miurafab.surfaces.catalogue import CATALOGUE, parse_target
from miurafab.workflow.design import design

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)
HOSTILE = st.sampled_from(
    ["", " ", "1", "80deg", "80", "1e400", "nan", "-1", "1,height=2", "1.toml", "x.stl", "../a/b",
     "/etc/passwd", "\x00", "1\n2", "$(id)", "';--", "20x20", "3mm", "exact", "seam", "1" * 300]
)  # fmt: skip


def body(**values):
    return json.dumps(values).encode()


@given(st.binary() | VALUES.map(lambda value: json.dumps(value).encode()))
def test_anything_else_is_refused_in_a_sentence(content):
    for read in (read_fit, read_layout, read_source):
        with pytest.raises(InputError, match=r"\.$"):
            read(content)


@given(
    st.sampled_from(sorted(CATALOGUE)),
    st.data(),
    st.dictionaries(st.sampled_from(sorted(FIT)), HOSTILE, max_size=3),
)
def test_a_fit_means_what_it_says_or_is_refused(surface, data, options):
    """Whatever is written into the fields: a named surface with these numbers, and no file."""
    keys = st.sampled_from([*CATALOGUE[surface].parameters, "profile", "mesh"])
    parameters = data.draw(st.dictionaries(keys, HOSTILE, max_size=2))
    asked = body(target={"surface": surface, "parameters": parameters}, options=options)
    try:
        order = read_fit(asked)
    except InputError:
        return
    given = {key: text.strip() for key, text in parameters.items() if text.strip()}
    assert parse_target(order.target) == (surface, given)
    assert design(order.target, **order.options).request.target["surface"] == surface


@pytest.mark.parametrize(
    ("target", "named"),
    [
        ({}, "surface"),
        ({"surface": "patterns/hypar.toml"}, "not a known surface"),
        ({"surface": "hypar", "parameters": {"height": "1.toml"}}, "not a number"),
        ({"surface": "revolution", "parameters": {"profile": "[[1, 0]]"}}, "profile"),
        ({"surface": "sphere", "parameters": {"width": "900deg"}}, "must be between"),
        ({"surface": "hypar", "parameters": {"height": 1}}, "text"),
        ({"source": ["1"]}, "text"),
    ],
)
def test_targets_that_are_none(target, named):
    with pytest.raises(InputError, match=named):
        read_fit(body(target=target))


@pytest.mark.parametrize(
    "options",
    [{"stock": "/etc/passwd"}, {"region": "0,1,0,1"}, {"gap": "3 parsec"},
     {"quantity": "many"}, {"quantity": "0"}, {"bridges": "1"}, {"two_sided": "yes"},
     {"full_facet": 1}, {"gap": ["2mm"]}, {"": ""}],
)  # fmt: skip
def test_layout_options_that_are_none(options):
    """In particular none that names a file or starts a program."""
    with pytest.raises(InputError, match=r"\.$"):
        read_layout(body(machine="grbl-laser-400", material="card-250", options=options))


@pytest.mark.parametrize("name", ["/tmp/own.toml", "../grbl-laser-400", "", None, 3, ["card-250"]])
def test_machines_and_materials_are_those_of_the_list(name):
    with pytest.raises(InputError, match="machine of the list"):
        read_layout(body(machine=name, material="card-250"))
    with pytest.raises(InputError, match="material of the list"):
        read_layout(body(machine="grbl-laser-400", material=name))


def test_no_field_names_a_file():
    assert not [name for name, field in (FIT | LAYOUT).items() if isinstance(field.kind, File)]


def test_command_lines():
    order = read_fit(
        body(
            target={"surface": "sphere", "parameters": {"width": "80 deg", "height": ""}},
            options={"facets": "12x10", "flat_foldable": "exact", "size": ""},
        )
    )
    command = fit_command(order.target, order.options, "sphere")
    assert command == (
        "miurafab fit 'sphere:width=80 deg' --facets 12x10 --flat-foldable exact -o sphere.fold"
    )
    assert shlex.split(command)[2] == order.target
    layout = read_layout(
        body(
            machine="grbl-laser-400",
            material="card-250",
            options={"two_sided": True, "full_facet": False, "quantity": "2", "gap": "3mm"},
        )
    )
    assert sheets_command("a b.fold", "a-b", layout, layout.options) == (
        "miurafab sheets 'a b.fold' -o a-b-job --machine grbl-laser-400 --material card-250 "
        "--two-sided --quantity 2 --gap 3mm"
    )


def test_the_design_file_asks_for_the_same(tmp_path):
    for surface, entry in CATALOGUE.items():
        angles = {key: "35deg" for key, value in entry.parameters.items() if value.kind.unit}
        parameters = angles or {list(entry.parameters)[-1]: "1.25"}
        options = {"facets": "6x8", "size": "12in", "amplitude": "0.3", "flat_foldable": "5deg"}
        order = read_fit(
            body(target={"surface": surface, "parameters": parameters}, options=options)
        )
        layout = {"machine": "grbl-laser-400", "material": "card-250", "bridges": 2, "gap": "3mm",
                  "two_sided": True}  # fmt: skip
        text = design_text('A "title"', {"surface": surface, **parameters}, options, layout)
        tomllib.loads(text)
        path = tmp_path / f"{surface}.toml"
        path.write_text(text, encoding="utf-8")
        written, asked = design(str(path)), design(order.target, **order.options)
        assert written.title == 'A "title"'
        assert (written.machine, written.material) == ("grbl-laser-400", "card-250")
        assert written.layout == read_options(
            LayoutOptions, {"bridges": 2, "gap": "3mm", "two_sided": True}
        )
        for name in ("target", "columns", "rows", "size_mm", "amplitude", "flat_foldable"):
            assert getattr(written.request, name) == getattr(asked.request, name)


def test_a_design_file_holds_any_letter():
    """JSON writes letters beyond 16 bits as pairs, which are no characters of TOML."""
    text = design_text("Fläche 😀", {"mesh": "a😀.stl"}, {}, {})
    assert tomllib.loads(text) == {"title": "Fläche 😀", "target": {"mesh": "a😀.stl"}}
