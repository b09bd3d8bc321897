"""``assembly.html``: the guide on a page for a tablet beside the sheet, one file without a network.

It has the sections of the printed guide. Pictures are SVG in the page, drawn by the same functions
as on paper. The same input gives the same bytes.
"""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from functools import partial

from reportlab.lib.units import mm

from miurafab.fabrication.drawing.neighbours import neighbours
from miurafab.fabrication.drawing.page import MARGIN, ROOM, Box
from miurafab.fabrication.drawing.sections import Block, Figure, Figures, Numbered, Prose, Section
from miurafab.fabrication.drawing.sheet_pages import SheetPages
from miurafab.fabrication.drawing.svg_canvas import Pen, SvgCanvas
from miurafab.fabrication.drawing.views import Views

_WIDE = 80.0
"""Pictures are drawn so wide, in mm, and scaled to the page by the browser: on 360 pixels the
smallest type is 10 pixels high."""
_STYLE = """
:root{color-scheme:light}
*{box-sizing:border-box}
body{margin:0 auto;padding:1rem;max-width:60rem;color:#1d2329;background:#fff;
font:1.0625rem/1.5 system-ui,"Segoe UI",Helvetica,Arial,sans-serif}
h1{font-size:1.7rem;margin:.5rem 0}h2{font-size:1.35rem;margin:2.2rem 0 0;padding-top:1rem;
border-top:1px solid #c3cad2}h3{font-size:1rem;margin:0}
.sub,dt{color:#5c6670}.sub{margin:.1rem 0 1rem}
nav ul{display:flex;flex-wrap:wrap;gap:.4rem;list-style:none;padding:0;margin:.5rem 0}
nav a{display:block;padding:.6rem .8rem;border:1px solid #c3cad2;border-radius:.5rem;
color:inherit;text-decoration:none}
ol{padding-left:1.6rem}li{margin:.4rem 0}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.3rem 1rem}dd{margin:0}
.figures{display:grid;gap:1.5rem;grid-template-columns:repeat(auto-fit,minmax(min(100%,17rem),1fr))}
.one{grid-template-columns:1fr}.one figure{overflow-x:auto}.one svg{min-width:36rem}
figure{margin:0;min-width:0}figcaption p{margin:.1rem 0 .4rem}
figure svg{display:block;width:100%;height:auto;max-height:85vh}
.step{display:inline-block;min-width:1.7em;margin-right:.5em;padding:0 .4em;border-radius:1em;
background:#1d2329;color:#fff;text-align:center}
.rows{columns:17rem;column-gap:1.5rem}
table{border-collapse:collapse;width:100%;break-inside:avoid;font-variant-numeric:tabular-nums}
th,td{padding:.15rem .5rem .15rem 0;text-align:left;border-bottom:1px solid #e4e8ec}
th{color:#5c6670;font-weight:400}td:first-child{font-weight:600}
@media print{nav{display:none}section{break-before:page}}
"""
_TOGETHER = 12
"""So many rows of a table stay together."""


def tablet_page(
    views: Views,
    title: str,
    facts: Sequence[tuple[str, Sequence[str]]],
    subtitle: str,
    sections: Sequence[Section],
) -> str:
    """The page with this ``title``: ``facts`` about the job, its sheets, and ``sections``."""
    parts = [_overview(views, facts), *_sheets(views), *sections]
    names = "".join(
        f'<li><a href="#s{k}">{_capital(each.title)}</a></li>' for k, each in enumerate(parts)
    )
    bodies = "".join(_section(k, each) for k, each in enumerate(parts))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{_e(title)}: assembly</title><style>{_STYLE}</style></head><body>"
        f'<header><h1>{_e(title)}</h1><p class="sub">{_e(subtitle)}</p></header>'
        f'<nav aria-label="Sections"><ul>{names}</ul></nav><main>{bodies}</main></body></html>\n'
    )


def _overview(views: Views, facts: Sequence[tuple[str, Sequence[str]]]) -> Section:
    figures = [Figure("Flat, seen from the front", views.flat_view, min(views.aspect, 1.2))]
    if views.pattern.folded_coords is not None:
        figures.insert(0, Figure("Folded", views.folded_view, 0.7))
    said = tuple(Prose(f"{name}: {'; '.join(lines)}") for name, lines in facts)
    return Section("overview", "", (Figures(2, tuple(figures)), *said))


def _sheets(views: Views) -> Iterator[Section]:
    """A section for each sheet: its picture, and to what each of its patches is glued."""
    layout = views.layout
    for sheet, toolpath in zip(layout.sheets, layout.toolpaths, strict=True):
        pages = SheetPages(views, sheet, toolpath, "")
        figure = Figure("The sheet", partial(_sheet, pages=pages), pages.tall / ROOM)
        lines = (
            Prose(f"{pages.label(each.patch)}: {'; '.join(neighbours(views, each.patch))}")
            for each in sheet.placements
        )
        yield Section(sheet.name, pages.subtitle(), (Figures(1, (figure,)), *lines))


def _sheet(canvas: Pen, box: Box, pages: SheetPages) -> None:
    """The drawing of a sheet, which is as wide as a page, in a box."""
    x, y, width, height = box
    scale = width / ROOM
    canvas.saveState()
    canvas.translate((x - MARGIN * scale) * mm, y * mm)
    canvas.scale(scale, scale)
    pages.draw_sheet(canvas, height / scale, pages.scale)
    canvas.restoreState()


def _section(number: int, section: Section) -> str:
    subtitle = f'<p class="sub">{_e(section.subtitle)}</p>' if section.subtitle else ""
    blocks = "".join(map(_block, section.blocks))
    return f'<section id="s{number}"><h2>{_capital(section.title)}</h2>{subtitle}{blocks}</section>'


def _block(block: Block) -> str:
    if isinstance(block, Prose):
        return f"<h3>{_e(block.words)}</h3>" if block.bold else f"<p>{_e(block.words)}</p>"
    if isinstance(block, Numbered):
        return f"<ol>{''.join(f'<li>{_e(line)}</li>' for line in block.lines)}</ol>"
    if isinstance(block, Figures):
        one = " one" if block.columns == 1 else ""
        return f'<div class="figures{one}">{"".join(map(_figure, block.figures))}</div>'
    head = "".join(f"<th>{_e(word)}</th>" for word in block.head)
    tables = []
    for first in range(0, len(block.rows), _TOGETHER):
        rows = "".join(
            f"<tr>{''.join(f'<td>{_e(word)}</td>' for word in row)}</tr>"
            for row in block.rows[first : first + _TOGETHER]
        )
        tables.append(f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>")
    return f'<div class="rows">{"".join(tables)}</div>'


def _figure(figure: Figure) -> str:
    canvas = SvgCanvas()
    tall = figure.aspect * _WIDE
    figure.draw(canvas, (0.0, 0.0, _WIDE, tall))
    number = f'<span class="step">{figure.number}</span>' if figure.number is not None else ""
    lines = "".join(f"<p>{_e(line)}</p>" for line in figure.lines)
    caption = f"<figcaption><h3>{number}{_e(figure.title)}</h3>{lines}</figcaption>"
    return f"<figure>{caption}{canvas.text(0.0, 0.0, _WIDE, tall, figure.title)}</figure>"


def _capital(words: str) -> str:
    return _e(words[:1].upper() + words[1:])


def _e(words: str) -> str:
    return html.escape(words, quote=False)
