"""``miurafab layers`` as a function: the order of the layers of a pattern that is folded flat.

A sheet that folds rigidly to its flat-folded end has its order in closed form, unless its facets
pass through each other on the way there. For any other pattern that folds flat, such as one with
unassigned creases, all orders are searched.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from miurafab.display import Shown
from miurafab.errors import PatternError
from miurafab.files import AnyPath, new_file
from miurafab.findings import Finding, findings_json
from miurafab.options import Whole, option, read_options
from miurafab.options.documented import described
from miurafab.options.verbs import verb
from miurafab.origami.cut_open import cut_open
from miurafab.origami.folding.layers import LayerOrder, layer_order
from miurafab.origami.folding.order_search import (
    DRAWN_WIDTH,
    MOST,
    LayerSearch,
    search_layer_orders,
)
from miurafab.origami.formats.fold import write_fold
from miurafab.workflow.patterns import PatternLike, movable_pattern


@dataclass(frozen=True)
class LayerOptions:
    """The options of a layer order."""

    orders: int | None = option(
        Whole(1, 100_000),
        "Search all layer orders, and stop after so many; needs python-sat.",
        default_text=f"{MOST} where the closed form gives no order, else no search",
    )


@dataclass(frozen=True, eq=False, repr=False)
class Layers(Shown):
    """The order of the layers of a pattern that is folded flat.

    Attributes
    ----------
    closed : LayerOrder or None
        The order in closed form. None for a pattern that does not fold rigidly.
    search : LayerSearch or None
        What a complete search found. None where none was asked for or needed.
    told : tuple of Finding
        What was changed or left out as the pattern was read.
    """

    closed: LayerOrder | None
    search: LayerSearch | None
    told: tuple[Finding, ...] = ()

    @property
    def order(self) -> LayerOrder | None:
        """The order in closed form if it is known, or else the first that was found."""
        found = () if self.search is None else self.search.orders
        if self.closed is not None and (self.closed.known or not found):
            return self.closed
        return found[0] if found else None

    @property
    def exists(self) -> bool:
        """Whether the layers have an order in which no facet passes through another."""
        found = self.order
        return found is not None and found.known

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What a person should know about the order."""
        of_motion = () if self.closed is None else layer_findings(self.closed)
        if self.search is not None:  # which decides what does not follow from the motion
            of_motion = tuple(each for each in of_motion if each.code != "undecided-layers")
        findings = self.told + of_motion
        if self.search is not None and not self.search.orders:
            sentence = (
                "The pattern cannot fold flat with these mountains and valleys: no order of its "
                "layers keeps its facets from passing through each other."
            )
            findings += (Finding("cannot-fold-flat", sentence),)
        if self.search is not None and self.search.folded.mismatch > DRAWN_WIDTH:
            sentence = (
                "Folded flat, facets of the drawing miss each other by up to "
                f"{self.search.folded.mismatch:.2g} mean edges, as its vertices are rounded; "
                "overlaps that are not much wider are left out."
            )
            findings += (Finding("rough-layers", sentence),)
        if self.search is not None and not self.search.complete:
            sentence = (
                f"There are more than {len(self.search.orders)} orders; the search ended there "
                "(`orders`)."
            )
            findings += (Finding("more-layer-orders", sentence),)
        return findings

    def report(self) -> dict[str, Any]:
        """The JSON answer of ``layers``; ``orders`` and ``complete`` are null without a search."""
        found = self.order
        return {
            "method": "search" if found is None or found is not self.closed else "closed form",
            "exists": self.exists,
            "orders": None if self.search is None else len(self.search.orders),
            "complete": None if self.search is None else self.search.complete,
            "agrees": self._agrees(),
            **({} if found is None else layer_facts(found)),
            "rules": None if self.search is None else self.search.rules,
            "findings": findings_json(self.findings),
        }

    def save(self, path: AnyPath, *, title: str = "") -> None:
        """Write the pattern, and the pattern folded flat with ``faceOrders``, to a FOLD file.

        Parameters
        ----------
        path : str or os.PathLike
            A ``.fold`` file.
        title : str
            The title inside the file. The default is the name of the target.

        Raises
        ------
        InputError
            For another ending, and for a folder that does not exist.
        PatternError
            For a pattern whose layers have no order.
        """
        file = new_file(path, "The pattern folded flat", (".fold",))
        if self.order is None or not self.exists:
            raise PatternError(f"{file} is not written, since the layers have no order.")
        pattern = self.order.folded.pattern
        write_fold(pattern, file, title or pattern.name, order=self.order)

    def _agrees(self) -> bool | None:
        """Whether the closed form is among the orders that were found; None if not compared."""
        if self.closed is None or self.search is None:
            return None
        mine = {tuple(triple) for triple in self.closed.face_orders().tolist()}
        for order in self.search.orders:
            theirs = {tuple(triple) for triple in order.face_orders().tolist()}
            if mine >= theirs:  # a search may pass over overlaps narrower than its tolerance
                return True
        return False

    def _summary(self) -> str:
        found = self.order
        pairs = "no order" if found is None else f"{len(found.above)} pairs of facets"
        if self.search is None:
            return pairs if found is None else f"{pairs}, in closed form"
        more = "" if self.search.complete else " and more"
        return f"{pairs}, orders found: {len(self.search.orders)}{more}"

    def _picture(self) -> str:
        return "" if self.order is None else self.order.folded.pattern._picture()

    def _facts(self) -> Mapping[str, object]:
        told = self.report()
        return {key: told[key] for key in ("method", "exists", "orders", "pairs") if key in told}


@verb
def layers(pattern: PatternLike, **options: Any) -> Layers:
    """Find the order of the layers of a pattern that is folded flat.

    Parameters
    ----------
    pattern : CreasePattern, FitResult, str or os.PathLike
        The pattern, or a file that :func:`load` reads.
    {options}

    Returns
    -------
    Layers
        ``.save("x.fold")`` writes the pattern folded flat with ``faceOrders``.

    Raises
    ------
    PatternError
        For a file that holds no pattern, and for a pattern that contradicts itself.
    InputError
        For a search where python-sat is not installed.
    OptionError
        For a name that is no option, and for a value that cannot be taken.

    Examples
    --------
    >>> import miurafab as mf
    >>> mf.layers(mf.fit("plane", facets=(4, 4), flat_foldable="exact"), orders=2)
    <Layers 120 pairs of facets, orders found: 1>
    """
    asked = read_options(LayerOptions, options)
    found = cut_open(movable_pattern(pattern))
    closed = None
    if "U" not in found.edges_assignment:  # by its motion an unassigned crease stays flat
        with contextlib.suppress(PatternError):
            closed = layer_order(found)
    if closed is not None and closed.known and asked.orders is None:
        return Layers(closed, None, found.told)
    try:
        search = search_layer_orders(found, asked.orders or MOST)
    except PatternError as fault:
        return Layers(closed, None, (*found.told, Finding("cannot-fold-flat", str(fault))))
    return Layers(closed, search, found.told)


described(layers, LayerOptions)


def layer_facts(order: LayerOrder) -> dict[str, Any]:
    """What reports tell of an order."""
    levels = order.levels
    return {
        "known": order.known,
        "pairs": len(order.above),
        "crossing": order.crossing.tolist(),
        "undecided": int((order.above == 0).sum()) - len(order.crossing),
        "levels": None if levels is None else int(levels.max(initial=-1)) + 1,
        "flat_mismatch": order.folded.mismatch,
    }


def layer_findings(order: LayerOrder) -> tuple[Finding, ...]:
    """What a person should know about an order in closed form."""
    findings = []
    pairs = len(order.crossing)
    if pairs:
        one, other = order.crossing[0].tolist()
        findings.append(
            Finding(
                "crossing-layers",
                f"As the sheet closes, {pairs} of {len(order.above)} pairs of facets that overlap "
                f"pass through each other, the first being {one} and {other}.",
                (one, other),
            )
        )
    undecided = int((order.above == 0).sum()) - pairs
    if undecided:
        findings.append(
            Finding(
                "undecided-layers",
                f"The order of {undecided} of {len(order.above)} pairs of facets folded flat does "
                "not follow from the motion; 'miurafab layers' can search for it.",
            )
        )
    return tuple(findings)
