"""Small runs whose maps are of the known walls."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from lrf3d import LaserRangeFinder, LineMap, ProportionalNoise, Run, World, simulate
from lrf3d.geometry.lines import Float, fit_line


def box(x: float, y: float, width: float, depth: float) -> Float:
    """Walls (4, 4) of a building with its lower left corner at x, y."""
    return ring([(x, y), (x + width, y), (x + width, y + depth), (x, y + depth)])


def ring(corners: list[tuple[float, float]]) -> Float:
    """Walls (n, 4) along the corners and back to the first."""
    ends = np.array(corners, dtype=np.float64)
    return np.hstack([ends, np.roll(ends, -1, axis=0)])


def make_world(*objects: Float, name: str = "") -> World:
    """World of some objects, each given by its walls (n, 4)."""
    labels = np.repeat(np.arange(len(objects)), [len(walls) for walls in objects])
    return World(np.vstack(objects), labels, name=name)


def street(x: float = 0.0, y: float = 0.0) -> World:
    """Two buildings next to each other."""
    return make_world(box(x, y, 10, 6), box(x + 14, y, 8, 6), name="street")


def make_run(
    world: World, poses: Float, lrf: LaserRangeFinder, *, sigma: float = 0.0, seed: int = 0
) -> Run:
    """Run from poses (k, 3), with the map that a mapper that knows each point's wall would make."""
    bare: Any = SimpleNamespace(update=lambda scan: None)
    noise = ProportionalNoise(sigma)
    run = simulate(world, poses, lrf, caster="planar", noise=noise, mapper=bare, rng=seed)
    return replace(run, snapshot_scans=(len(run) - 1,), maps=(fit_walls(run),))


def fit_walls(run: Run) -> LineMap:
    """One segment for each wall that returned at least three points, in one union an object."""
    points = np.vstack([scan.points() for scan in run.scans])
    owner = np.concatenate([scan.walls[scan.hits] for scan in run.scans])
    segments, objects, counts = [], [], []
    for wall in np.unique(owner):
        on_wall = points[owner == wall]
        if len(on_wall) < 3:
            continue
        mean, along = fit_line(on_wall)
        place = (on_wall - mean) @ along
        segments.append(np.concatenate([mean + place.min() * along, mean + place.max() * along]))
        objects.append(run.world.objects[wall])
        counts.append(len(on_wall))
    return LineMap(np.array(segments), np.array(objects), np.array(counts))


def around(x: float, y: float, radius: float, count: int, heading: float = np.pi) -> Float:
    """Poses (count, 3) on a circle; heading is counted from the outward direction."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.column_stack(
        [x + radius * np.cos(angle), y + radius * np.sin(angle), angle + heading]
    )


def as_map(segments: Float, objects: object = None) -> LineMap:
    """A map of segments (n, 4), all of one union where no labels are given."""
    count = len(segments)
    labels = np.zeros(count, np.int64) if objects is None else np.asarray(objects)
    return LineMap(np.asarray(segments, dtype=np.float64), labels, np.full(count, 2))
