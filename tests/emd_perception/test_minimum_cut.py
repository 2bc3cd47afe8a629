"""Tests of the minimum cut of a graph of pixels: against SciPy's maximum flow."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from emd_perception.minimum_cut import source_side

STEPS = [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1)]


def random_graph(
    seed: int, shape: tuple[int, int], largest: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Neighbours, capacities (other ones each way) and preferences of a picture with holes."""
    rng = np.random.default_rng(seed)
    present = rng.random(shape) < 0.9
    nodes = np.full((shape[0] + 2, shape[1] + 2), -1, dtype=np.int32)
    nodes[1:-1, 1:-1][present] = np.arange(present.sum())
    rows, columns = np.nonzero(nodes >= 0)
    neighbours = np.stack([nodes[rows + v, columns + u] for v, u in STEPS], axis=-1)
    capacities = rng.integers(0, largest, neighbours.shape).astype(np.int32)
    preference = rng.integers(-2 * largest, 2 * largest, len(neighbours)).astype(np.int32)
    preference[rng.random(len(preference)) < 0.5] = 0
    return neighbours, np.where(neighbours < 0, 0, capacities), preference


def side_by_scipy(
    neighbours: NDArray[np.int32], capacities: NDArray[np.int32], preference: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """What the source still reaches when SciPy's maximum flow runs."""
    count = len(preference)
    source, sink = count, count + 1
    tails, ways = np.nonzero(neighbours >= 0)
    every = np.arange(count)
    links = (
        (tails, neighbours[tails, ways], capacities[tails, ways]),
        (np.full(count, source), every, np.maximum(preference, 0)),
        (every, np.full(count, sink), np.maximum(-preference, 0)),
    )
    row, column, value = (np.concatenate(part) for part in zip(*links, strict=True))
    graph = csr_array(coo_array((value, (row, column)), shape=(count + 2, count + 2)))
    left = graph - maximum_flow(graph, source, sink).flow
    left.eliminate_zeros()
    reached = breadth_first_order(left, source, return_predecessors=False)
    return np.isin(every, reached)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("largest", [2, 5, 2500])
def test_the_cut_is_that_of_scipys_maximum_flow(seed: int, largest: int) -> None:
    """The same side node by node, also where many cuts are equally good."""
    graph = random_graph(seed, (37, 23), largest)
    np.testing.assert_array_equal(source_side(*graph), side_by_scipy(*graph))


def test_a_graph_with_one_side_only_is_not_cut() -> None:
    """Without a sink all that the source reaches is its, without a source nothing."""
    neighbours, capacities, _ = random_graph(0, (6, 5), 9)
    capacities[neighbours >= 0] += 1
    preference = np.zeros(len(neighbours), np.int32)
    preference[3] = 5
    assert source_side(neighbours, capacities, preference).all()
    assert not source_side(neighbours, capacities, -preference).any()


def test_the_callers_arrays_are_left_as_they_are() -> None:
    """Capacities and preferences are not used up."""
    graph = random_graph(1, (12, 9), 50)
    before = [one.copy() for one in graph]
    source_side(*graph)
    for one, other in zip(graph, before, strict=True):
        np.testing.assert_array_equal(one, other)
