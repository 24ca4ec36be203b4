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
