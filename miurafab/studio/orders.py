"""The orders of the page, read strictly: known keys, short texts, names from lists.

Nothing that the browser sends is taken for a path. Surfaces, machines and materials are those of
the lists, parameters are numbers, and a file is the number of an upload. Options are those with a
field on the page (:mod:`~miurafab.studio.form`); none of them names a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from miurafab.errors import InputError, MiurafabError, TargetError
from miurafab.fabrication.options import LayoutOptions
from miurafab.files import parse_json
from miurafab.options import Declared, Flag, Whole, read_options
from miurafab.profiles import known_names
from miurafab.studio.form import FIT, LAYOUT
from miurafab.studio.recipe import Value
from miurafab.surfaces.catalogue import CATALOGUE, make_surface
from miurafab.surfaces.profile_files import LARGEST
from miurafab.workflow.design import design
from miurafab.workflow.drawings import read_formats
from miurafab.workflow.image_targets import PARAMETERS as OF_IMAGE

_LONGEST = 500
_MOST_POINTS = 200
"""Points of a profile that was drawn on the page."""


@dataclass(frozen=True)
class FitOrder:
    """A fit to a named ``surface`` with its ``parameters``, or to the file of ``source``.

    ``replaces`` is the number of the task whose place it takes, if that one still runs. The options
    hold the ``profile`` that was drawn, if one was.
    """

    surface: str | None
    parameters: Mapping[str, str]
    source: str | None
    options: Mapping[str, Value]
    replaces: str = ""

    def as_dict(self) -> dict[str, Any]:
        """The order as the page wrote it."""
        target: dict[str, Any] = {"source": self.source}
        if self.surface is not None:
            target = {"surface": self.surface}
        if self.surface is not None or self.parameters:
            target["parameters"] = dict(self.parameters)
        options = dict(self.options)
        if "profile" in options:
            target["profile"] = options.pop("profile")
        return {"target": target, "options": options}

    @property
    def target(self) -> str:
        """The named surface as the command line writes it."""
        assert self.surface is not None
        return self.on(self.surface)

    def on(self, name: str) -> str:
        """The surface or the file ``name`` with its parameters, as the command line writes it."""
        values = ",".join(f"{key}={value}" for key, value in self.parameters.items())
        return f"{name}:{values}" if values else name


@dataclass(frozen=True)
class LayoutOrder:
    """A layout for a known ``machine`` and ``material``, with options as in a design file.

    ``stock`` is the number of an uploaded file, empty for sheets of the bed's size; ``formats``
    are drawings besides those that there always are, comma-separated.
    """

    machine: str
    material: str
    options: Mapping[str, Value] = field(default_factory=dict)
    stock: str = ""
    formats: str = ""


def read_fit(body: bytes) -> FitOrder:
    """The fit that ``body``, JSON, asks for. A named surface is made here, to find faults early.

    Raises :class:`~miurafab.errors.InputError` or ``TargetError``.
    """
    order = read_order(body, ("target", "options", "replaces"))
    return replace(_fit_of(order), replaces=text_of("replaces", order.get("replaces", "")))


def read_glance(body: bytes) -> tuple[FitOrder, LayoutOrder | None]:
    """The fit that a coarse answer is asked for, and the layout that the form of the sheets stands
    for, None where a field of it holds something wrong. Raises as :func:`read_fit`.
    """
    order = read_order(body, ("target", "options", "layout"))
    return _fit_of(order), _layout_beside(order.get("layout"))


def read_plan(body: bytes) -> LayoutOrder | None:
    """The layout for which the pattern on the bench is planned; as in :func:`read_glance`."""
    return _layout_beside(read_order(body, ("layout",)).get("layout"))


def _layout_beside(value: Any) -> LayoutOrder | None:
    try:
        return _layout_of(_table(value, "The layout"))
    except MiurafabError:  # the form of the sheets says so where it is used
        return None


def _fit_of(order: Mapping[str, Any]) -> FitOrder:
    target = _table(order.get("target"), "The target")
    options = _options(order.get("options", {}), FIT)
    if "source" in target:
        given = _texts(_table(target.get("parameters", {}), "The parameters"), tuple(OF_IMAGE))
        return FitOrder(None, given, text_of("source", target["source"]), options)
    surface = text_of("surface", target.get("surface"))
    if target.get("profile") is not None:
        options["profile"] = _profile(target["profile"])
    return _named(surface, target.get("parameters", {}), options)


def _profile(points: Any) -> list[list[float]]:
    """Points that were drawn, as numbers."""
    if not isinstance(points, list) or not 2 <= len(points) <= _MOST_POINTS:
        raise TargetError(f"A profile has 2 to {_MOST_POINTS} points.")
    for point in points:
        if not isinstance(point, list) or len(point) != 2 or not all(map(_is_place, point)):
            raise TargetError("A point of a profile is two numbers.")
    return [[float(x), float(y)] for x, y in points]


def _is_place(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST


def _named(surface: str, parameters: Any, options: Mapping[str, Value]) -> FitOrder:
    if surface not in CATALOGUE:
        raise TargetError(f"'{surface}' is not a known surface.")
    entry = CATALOGUE[surface]
    keys = (*entry.formulas, *entry.parameters)
    given = _texts(_table(parameters, "The parameters"), keys)
    make_surface(surface, given)
    order = FitOrder(surface, given, None, options)
    design(order.target, **options)
    return order


def read_source(body: bytes) -> str:
    """The source to open. Raises :class:`~miurafab.errors.InputError`."""
    return text_of("source", read_order(body, ("source",)).get("source"))


def read_layout(body: bytes) -> LayoutOrder:
    """The layout that ``body``, JSON, asks for. Its options are read here, to find faults early.

    Raises :class:`~miurafab.errors.InputError`.
    """
    return _layout_of(read_order(body, ("machine", "material", "options", "stock", "formats")))


def _layout_of(order: Mapping[str, Any]) -> LayoutOrder:
    machine = listed("machine", order.get("machine"), known_names("firmware_profiles"))
    material = listed("material", order.get("material"), known_names("materials"))
    options = _options(order.get("options", {}), LAYOUT)
    read_options(LayoutOptions, options)
    stock = text_of("stock", order.get("stock", ""))
    formats = text_of("formats", order.get("formats", ""))
    return LayoutOrder(machine, material, options, stock, ",".join(read_formats(_parts(formats))))


def _parts(text: str) -> list[str]:
    return [part for part in text.split(",") if part]


def _options(given: Any, fields: Mapping[str, Declared]) -> dict[str, Value]:
    """The options with a value, as a design file writes them."""
    options: dict[str, Value] = {}
    for name, value in _table(given, "The options").items():
        if name not in fields:
            raise InputError(f"'{name[:40]}' cannot be set here.")
        kind = fields[name].kind
        if isinstance(kind, Flag) and isinstance(value, bool):
            if value:
                options[name] = True
            continue
        text = text_of(name, value)
        if text:
            whole = isinstance(kind, Whole) and text.isascii() and text.isdigit()
            options[name] = int(text) if whole else text
    return options


def read_order(body: bytes, keys: tuple[str, ...]) -> dict[str, Any]:
    """The table in ``body``, JSON, with no other keys than ``keys``."""
    try:
        order = parse_json(body.decode("utf-8"))
    except (ValueError, RecursionError):
        raise InputError("The page sent something that is not JSON; reload it.") from None
    table = _table(order, "The order")
    for key in table:
        if key not in keys:
            raise InputError(f"The studio does not know '{key[:40]}'; reload the page.")
    return table


def _table(value: Any, what: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{what} must be a table of names and values.")
    return value


def _texts(values: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, str]:
    """The texts of ``values``, in the order of ``keys``, without those that are empty."""
    for key in values:
        if key not in keys:
            raise InputError(f"'{key[:40]}' cannot be set here; there are {', '.join(keys)}.")
    texts = {key: text_of(key, values[key]) for key in keys if key in values}
    return {key: text for key, text in texts.items() if text}


def text_of(key: str, value: Any) -> str:
    """``value`` if it is a text of one line; ``key`` is its name."""
    if not isinstance(value, str) or len(value) > _LONGEST or not value.isprintable():
        raise InputError(f"'{key[:40]}' must be a text of one line.")
    return value.strip()


def listed(key: str, value: Any, names: list[str]) -> str:
    """``value`` if it is one of ``names``; ``key`` says of what kind they are."""
    if value not in names:
        raise InputError(f"Choose a {key} of the list: {', '.join(names)}.")
    return str(value)
