import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lrf3d.slam.graph_distance import DistanceGraph, insert, remove_least


@settings(max_examples=30, deadline=None)
@given(st.integers(2, 600), st.integers(0, 2**32 - 1), st.floats(1.0, 50.0))
def test_distances_are_those_of_dijkstra(count, seed, limit):
    rng = np.random.default_rng(seed)
    links = [(k - 1, k) for k in range(1, count)] + rng.integers(0, count, (count, 2)).tolist()
    graph, table = DistanceGraph(), np.full((count, count), np.inf)
    for _ in range(count):
        graph.add()
    for first, second in links:
        length = float(rng.uniform(0.5, 5.0))
        graph.link(first, second, length)
        table[first, second] = min(table[first, second], length)
    rows, columns = np.nonzero(np.isfinite(table))
    known = csr_array((table[rows, columns], (rows, columns)), shape=table.shape)
    expected = dijkstra(known, directed=False, indices=np.array([0]), limit=limit)[0]
    assert np.allclose(graph.distances(0, limit, np.ones(count, bool)), expected)
    wanted = rng.random(count) < 0.1
    assert np.allclose(graph.distances(0, limit, wanted)[wanted], expected[wanted])


@settings(max_examples=20, deadline=None)
@given(st.integers(3, 300), st.integers(0, 2**32 - 1))
def test_a_search_for_one_key_scan_ends_no_sooner_than_its_shortest_way_is_known(count, seed):
    """Long direct links are found first, and many short ones round about are shorter."""
    rng = np.random.default_rng(seed)
    graph, table = DistanceGraph(), np.full((count, count), np.inf)
    for _ in range(count):
        graph.add()
    far = rng.integers(0, count, (4 * count, 2)).tolist()
    for first, second in [*far, *((k - 1, k) for k in range(1, count))]:
        # The farther apart, the longer than the way along the chain, mostly.
        length = float(abs(first - second) * rng.uniform(0.3, 3.0) + 0.01)
        graph.link(first, second, length)
        table[first, second] = min(table[first, second], length)
    rows, columns = np.nonzero(np.isfinite(table))
    known = csr_array((table[rows, columns], (rows, columns)), shape=table.shape)
    for start in rng.integers(0, count, 3).tolist():
        expected = dijkstra(known, directed=False, indices=np.array([start]))[0]
        for end in rng.integers(0, count, 12).tolist():
            found = graph.distances(start, np.inf, np.arange(count) == end)
            assert np.isclose(found[end], expected[end])
            assert (found >= expected - 1e-9).all()


def chain(count, length=1.0):
    graph = DistanceGraph()
    for _ in range(count):
        graph.add()
    for k in range(1, count):
        graph.link(k - 1, k, length)
    return graph


def test_a_chain_is_as_long_from_either_end():
    graph, all_of = chain(700), np.ones(700, bool)
    assert graph.distances(0, np.inf, all_of).tolist() == list(range(700))
    assert graph.distances(699, np.inf, all_of).tolist() == list(range(699, -1, -1))


def test_a_limit_includes_what_is_just_as_far():
    found = chain(9).distances(4, 2.0, np.ones(9, bool))
    assert found.tolist() == [np.inf, np.inf, 2, 1, 0, 1, 2, np.inf, np.inf]


def test_a_search_ends_with_the_last_that_is_wanted():
    wanted = np.isin(np.arange(50), [3, 7])
    found = chain(50).distances(0, np.inf, wanted)
    assert found[:8].tolist() == list(range(8)) and np.isinf(found[8:]).all()


def test_of_two_links_between_the_same_the_shorter_one_counts():
    graph = chain(3, length=2.0)
    graph.link(2, 0, 5.0)
    graph.link(2, 0, 1.0)
    assert graph.distances(0, np.inf, np.ones(3, bool)).tolist() == [0.0, 2.0, 1.0]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 30) | st.none(), max_size=60))
def test_a_heap_gives_its_nodes_in_the_order_of_their_keys(work):
    """Numbers are inserted; None removes the least. Only kernels call what is compiled of it."""
    push, pop = (getattr(part, "py_func", part) for part in (insert, remove_least))
    nodes, keys, inside = np.zeros(64, np.int64), np.zeros(64), []
    for node, key in enumerate(work):
        if key is not None:
            push(nodes, keys, len(inside), node, float(key))
            inside.append((float(key), node))
        elif inside:
            least = keys[0], nodes[0]
            assert least in inside and least[0] == min(inside)[0]
            inside.remove(least)
            pop(nodes, keys, len(inside))
        assert sorted(zip(keys[: len(inside)], nodes[: len(inside)], strict=True)) == sorted(inside)
