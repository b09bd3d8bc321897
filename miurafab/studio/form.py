"""The fields of the page, made of the declarations of the options that the page offers."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from miurafab.errors import spell_options
from miurafab.fabrication.options import LayoutOptions
from miurafab.options import Choice, Declared, Flag, Whole, declared
from miurafab.origami.fitting.request import FitOptions

FIT = {name: field for name, field in declared(FitOptions).items() if field.page}
LAYOUT = {name: field for name, field in declared(LayoutOptions).items() if field.page}

LABELS = {name: field.label for name, field in (FIT | LAYOUT).items()}


def filled(page: str) -> str:
    """The page with its fields, each where ``<!-- fit first -->`` and its like stand."""
    for form, fields in (("fit", FIT), ("layout", LAYOUT)):
        for place in ("first", "more", "mesh"):
            rows = "\n".join(_row(field) for field in fields.values() if field.page == place)
            page = page.replace(f"<!-- {form} {place} -->", rows)
    return page


def by_label(sentence: str) -> str:
    """``sentence`` with each option called as its field on the page is, if it has one."""
    return spell_options(sentence, lambda name: f"'{LABELS.get(name, name)}'")


def _row(field: Declared) -> str:
    return f'<div class="row" id="{field.name}-row">{"".join(_parts(field))}</div>'


def _parts(field: Declared) -> Iterator[str]:
    name, kind, meaning = field.name, field.kind, escape(spell_options(field.help, _bare))
    if isinstance(kind, Flag):
        yield f'<label class="check"><input type="checkbox" name="{name}">{meaning}</label>'
        return
    yield f'<label for="{name}">{escape(field.label)} <small>{meaning}</small></label>'
    if isinstance(kind, Choice):
        yield f'<select id="{name}" name="{name}">'
        if field.default is None:
            yield f'<option value="">{escape(field.default_text)}</option>'
        for choice in kind.names:  # the default is not sent
            value = "" if choice == field.default else choice
            yield f'<option value="{value}">{choice}</option>'
        yield "</select>"
    else:
        mode = ' inputmode="numeric"' if isinstance(kind, Whole) else ""
        yield (
            f'<input id="{name}" name="{name}" placeholder="{escape(field.default_text)}"{mode} '
            'autocomplete="off" spellcheck="false">'
        )


def _bare(name: str) -> str:
    return name.replace("_", " ")
