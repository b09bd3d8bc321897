"""Components, shortest ways and least cuts, each against its definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from miurafab.geometry.connected import components, minimum_cut, shortest_ways

LINKS = st.integers(1, 7).flatmap(
    lambda count: st.tuples(
        st.just(count),
        st.lists(
            st.tuples(st.integers(0, count - 1), st.integers(0, count - 1), st.integers(1, 9)),
            max_size=14,
        ),
    )
)


def _arrays(links):
    return np.array(links, dtype=np.int64).reshape(-1, 3).T


def _distances(count, links):
    """The lengths of all shortest ways, by the sums over all nodes between (Floyd and Warshall)."""
    far = np.full((count, count), np.inf)
    np.fill_diagonal(far, 0)
    for one, other, length in links:
        if one != other:
            far[one, other] = far[other, one] = min(far[one, other], length)
    for node in range(count):
        far = np.minimum(far, far[:, [node]] + far[node])
    return far


@given(LINKS)
def test_a_component_has_the_nodes_between_which_a_way_leads(case):
    count, links = case
    one, other, _ = _arrays(links)
    found = components(count, one, other)
    assert ((found[:, None] == found) == np.isfinite(_distances(count, links))).all()
    _, first = np.unique(found, return_index=True)
    assert (np.diff(first) > 0).all()
    assert found.max() == len(first) - 1


@given(LINKS, st.data())
def test_a_way_is_shortest_and_leads_from_node_to_node(case, data):
    count, links = case
    starts = np.array(sorted(data.draw(st.sets(st.integers(0, count - 1), min_size=1))))
    one, other, length = _arrays(links)
    distance, before, link = shortest_ways(count, one, other, length.astype(float), starts)
    expected = _distances(count, links)[starts].min(axis=0)
    np.testing.assert_array_equal(distance, expected)
    led = np.setdiff1d(np.flatnonzero(np.isfinite(expected)), starts)
    assert (before[np.setdiff1d(np.arange(count), led)] < 0).all()
    assert ((link >= 0) == np.isin(np.arange(count), led)).all()
    for node in led.tolist():
        last = int(link[node])
        assert {int(one[last]), int(other[last])} == {node, int(before[node])}
        assert distance[node] == distance[before[node]] + length[last]
        parallel = [n for n, (a, b, _) in enumerate(links) if {a, b} == {node, int(before[node])}]
        assert last == min(parallel, key=lambda n: links[n][2])


@given(LINKS.filter(lambda case: case[0] > 1))
def test_no_cut_lets_less_pass(case):
    count, links = case
    tails, heads, capacity = _arrays(links)
    least, near = minimum_cut(count, tails, heads, capacity.astype(np.int32), 0, count - 1)
    assert near[0]
    assert not near[-1]

    def passing(side):
        return int(capacity[side[tails] & ~side[heads]].sum())

    assert passing(near) == least
    sides = [
        np.array([True, *(bits >> k & 1 for k in range(count - 2)), False], dtype=bool)
        for bits in range(2 ** (count - 2))
    ]
    assert least == min(passing(side) for side in sides)


@pytest.mark.parametrize("count", [1, 5])
def test_without_links_every_node_is_apart(count):
    none = np.zeros(0, dtype=np.int64)
    assert components(count, none, none).tolist() == list(range(count))
