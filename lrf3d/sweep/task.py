"""The work of a worker: runs at one place, each a pure function of its arguments.

The input is a place with the runs to make there; the output is a row of figures for each.
"""

import pickle
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from lrf3d.casting import PlanarCaster
from lrf3d.laser import Noise
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scoring import buildings_seen, score_run
from lrf3d.scoring.visibility import visible_walls
from lrf3d.world.touching import joined_objects

Row = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Place:
    """A world with a drive and a range finder, which determine the scans without noise.

    Args:
        scenario: The scenario; its mapper and its noise are not used.
        trajectory: The drive.
    """

    scenario: Scenario
    trajectory: Trajectory

    @cached_property
    def caster(self) -> PlanarCaster:
        """The caster, shared by all runs at this place."""
        return PlanarCaster(self.scenario.world)

    def packed(self) -> bytes:
        """The place for sending to workers; building a caster is faster than sending it."""
        return pickle.dumps((replace(self.scenario, mapper={}), self.trajectory), protocol=5)


def unpack(packed: bytes) -> Place:
    """The place that was packed."""
    return Place(*pickle.loads(packed))


class Order(NamedTuple):
    """A run to make at a place.

    Attributes:
        key: The key of the run.
        noise: Turns true scans into measured ones.
        mapper: Keyword arguments for the mapper.
        seed: Seed of the noise.
    """

    key: str
    noise: Noise
    mapper: Mapping[str, Any]
    seed: int


class BatchResult(NamedTuple):
    """The rows of some runs, and their duration [s]."""

    rows: list[Row]
    seconds: float


def carry_out(place: Place, orders: Sequence[Order]) -> BatchResult:
    """Make some runs at a place."""
    start = time.perf_counter()
    rows = [{"key": order.key, **figures(run_of(place, order))} for order in orders]
    return BatchResult(rows, time.perf_counter() - start)


def run_of(place: Place, order: Order) -> Run:
    """One run, simulated."""
    scenario = replace(place.scenario, mapper=dict(order.mapper), noise=order.noise)
    return scenario.run(drive=place.trajectory, rng=order.seed, caster=place.caster, snapshots=1)


def figures(run: Run) -> Row:
    """The figures of a run that a sweep keeps, in JSON's types."""
    _, walls = visible_walls(run)
    visible = len(set(joined_objects(run.world)[walls].tolist()))
    buildings = buildings_seen(run)
    return {
        **score_run(run).as_dict(),
        "map_objects": run.map.object_count,
        "visible_objects": visible,
        "object_ratio": run.map.object_count / visible if visible else None,
        "seen_on_all_sides": buildings.seen_on_all_sides,
        "whole": buildings.whole,
    }
