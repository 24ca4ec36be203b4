import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from lrf3d.slam.graph_distance import DistanceGraph


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
