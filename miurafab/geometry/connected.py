"""What hangs together in a graph: its components, the shortest ways and the least cuts in it.

The library for graphs takes a fifth of a second to load. It is loaded by the first function that
is called, because a job that is only read has no use for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from miurafab.geometry.arrays import Bools, Floats, Ints, places_among


def components(count: int, one: Ints, other: Ints) -> Ints:
    """The connected component (count,) of each node, numbered from 0 by their first nodes.

    Parameters
    ----------
    count : int
        The number of nodes.
    one, other : (n,) array of int
        The two nodes of each link.

    Examples
    --------
    >>> components(5, np.array([0, 3]), np.array([4, 1])).tolist()
    [0, 1, 2, 1, 0]

    Source: D. J. Pearce, *An improved algorithm for finding the strongly connected components of a
    directed graph* (2005), as in ``scipy.sparse.csgraph``.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(one)), (one, other)), shape=(count, count))
    return connected_components(links, directed=False)[1].astype(np.int64)


class Ways(NamedTuple):
    """The shortest ways to the nodes of a graph: how long each is, and its last link.

    ``distance`` (count,) is 0 where the ways start and inf where none leads. ``before`` (count,) is
    the node before, and ``link`` (count,) the link from there; both are below 0 where there is
    none.
    """

    distance: Floats
    before: Ints
    link: Ints


def shortest_ways(count: int, one: Ints, other: Ints, lengths: Floats, starts: Ints) -> Ways:
    """The shortest way to each node from the nearest of some others.

    Parameters
    ----------
    count : int
        The number of nodes.
    one, other : (n,) array of int
        The two nodes of each link.
    lengths : (n,) array of float
        The length of each link, over 0. Of several links between two nodes the shortest counts,
        and the first of equals.
    starts : (k,) array of int
        The nodes from which the ways lead.

    Source: E. W. Dijkstra, *A note on two problems in connexion with graphs* (1959), as in
    ``scipy.sparse.csgraph``.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    order = np.argsort(lengths, kind="stable")
    keys, first = np.unique(_keys(count, one, other)[order], return_index=True)
    kept = order[first]
    links = coo_array((lengths[kept], (one[kept], other[kept])), shape=(count, count)).tocsr()
    distance, last, _ = dijkstra(
        links, directed=False, indices=starts, return_predecessors=True, min_only=True
    )
    before: Ints = last.reshape(count).astype(np.int64)
    led = np.flatnonzero(before >= 0)
    link = np.full(count, -1, dtype=np.int64)
    link[led] = kept[places_among(keys, _keys(count, led, before[led]))]
    return Ways(distance.reshape(count), before, link)


def _keys(count: int, one: Ints, other: Ints) -> Ints:
    """(n,) a number for the two nodes of each link, whichever is first."""
    return np.minimum(one, other).astype(np.int64) * count + np.maximum(one, other)


def minimum_cut(
    count: int, tails: Ints, heads: Ints, capacity: Ints, source: int, sink: int
) -> tuple[int, Bools]:
    """The least capacity of all links from the side of ``source`` to that of ``sink``.

    Parameters
    ----------
    count : int
        The number of nodes.
    tails, heads : (n,) array of int
        The nodes where each link begins and ends.
    capacity : (n,) array of int32
        What each link lets pass; those of several links between two nodes are added.
    source, sink : int
        The two nodes that are to be apart.

    Returns
    -------
    least : int
        The sum of the capacities that are cut.
    near : (count,) array of bool
        The nodes on the side of ``source``; where there are several least cuts, the fewest.

    Source: E. A. Dinic, *Algorithm for solution of a problem of maximum flow in networks with power
    estimation* (1970), as in ``scipy.sparse.csgraph``.
    """
    from scipy.sparse import coo_array, csr_array
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    links = csr_array((capacity, (tails, heads)), shape=(count, count))
    flow = maximum_flow(links, source, sink)
    rest = coo_array(links - flow.flow)
    more = rest.data > 0
    ahead = csr_array((rest.data[more], (rest.row[more], rest.col[more])), shape=(count, count))
    near = np.zeros(count, dtype=bool)
    near[breadth_first_order(ahead, source, return_predecessors=False)] = True
    return int(flow.flow_value), near
