"""The order of the layers in closed form against complete search, on twelve exact sheets.

    python benchmarks/layer_orders.py [--most 4] [TARGET:CELLS ...]

Prints for each sheet the pairs of facets that overlap when folded flat, the rules that a search has
to keep, the orders that it found (+ where it ended at --most), the rules that the closed form
breaks, by how many pairs it differs from the nearest order found, and processor seconds. Exits 1 if
the closed form breaks a rule, leaves a pair open, or is not among the orders of a whole search.
"""

from __future__ import annotations

import argparse
import sys
import time

from miurafab.origami.fitting.fit import FitRequest, fit
from miurafab.origami.folding.layers import EXACT_WIDTH, layer_order
from miurafab.origami.folding.order_search import broken_rules, search_layer_orders
from miurafab.surfaces.catalogue import make_surface

SHEETS = (
    *(f"hypar:{cells}" for cells in (4, 6, 8, 12, 20)),
    *("saddle:6", "sphere:6", "sphere:12", "bump:8", "paraboloid:8", "cylinder:8", "helicoid:8"),
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sheets", nargs="*", default=SHEETS)
    parser.add_argument("--most", type=int, default=4)
    options = parser.parse_args()
    print(
        f"{'sheet':<14} {'pairs':>6} {'triples':>8} {'tortillas':>9} {'tacos':>6} {'orders':>6} "
        f"{'broken':>6} {'differ':>6} {'closed s':>9} {'search s':>9}"
    )
    failed = False
    for sheet in options.sheets:
        name, _, cells = sheet.partition(":")
        surface, _ = make_surface(name, {})
        facets = (int(cells), int(cells))
        found = fit(FitRequest(surface=surface, facets=facets, size_mm=200.0, flat_foldable=0.0))
        if found.pattern is None:
            print(f"{sheet:<14} {found.advice}")
            failed = True
            continue
        start = time.process_time()
        order = layer_order(found.pattern)
        between = time.process_time()
        search = search_layer_orders(found.pattern, options.most, EXACT_WIDTH)
        end = time.process_time()
        broken = broken_rules(order)
        differ = min((int((each.above != order.above).sum()) for each in search.orders), default=-1)
        rules, more = search.rules, "" if search.complete else "+"
        print(
            f"{sheet:<14} {len(order.above):>6} {rules['triples']:>8} {rules['tortillas']:>9} "
            f"{rules['tacos']:>6} {len(search.orders):>5}{more or ' '} {broken:>6} {differ:>6} "
            f"{between - start:>9.2f} {end - between:>9.2f}",
            flush=True,
        )
        failed |= broken > 0 or not order.known or (search.complete and differ != 0)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
