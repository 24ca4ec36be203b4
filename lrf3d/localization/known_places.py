"""Known places: a map as key scans, and the places in it where a scan fits, without a first guess.

A run, whose scans show the map, or a world, in which scans are cast from all over its free space,
enters. All of its free cells and all headings are searched for a scan; the places where its beams
met the walls of the map, and passed through no others, leave.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lrf3d.casting import PlanarCaster
from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder
from lrf3d.planning.free_space import free_places
from lrf3d.pose import between, compose
from lrf3d.run import Run
from lrf3d.slam.front_end import KEY_DISTANCE, KEY_TURN
from lrf3d.slam.key_scans import Key, Sight, same_place
from lrf3d.slam.motion import size_of
from lrf3d.slam.search import (
    CELL,
    FREE,
    LOOSE,
    Field,
    Place,
    Submap,
    field_of,
    thin,
    window_scores,
)
from lrf3d.world import World

SPACING, BEAMS, REACH = 1.0, 720, 30.0
"""Distance of the scans that are cast in a world [m], their beams, and their range [m]."""

MOST_SCANS, MOST_CELLS = 3000, 80_000
"""Most scans that are cast, and cells that are searched: in a town both lie farther apart."""

ROOM = 0.25
"""Distance from walls at which a robot may be [m]."""

STRIDE, STEP = 2, 0.04
"""Stride of the search in cells, and step of its headings [rad]."""

PEAKS, NEXT, NEXT_TURN = 80, 0.7, 0.25
"""Most poses that are matched, and their least distance [m] or turn [rad] from each other."""

PARTS, MOST_PEAKS = 16, 600
"""Parts of the headings that are searched one after another, and poses kept of each."""

AROUND = 6
"""Key scans that a place is judged by, the nearest."""


@dataclass(frozen=True, eq=False)
class KnownPlaces:
    """Key scans (k,) at poses (k, 3), which show a map; those of a run by their numbers (k,)."""

    name: str
    keys: list[Key]
    poses: Float = field(repr=False)
    numbers: Int = field(default_factory=lambda: np.empty(0, np.int64))

    @classmethod
    def from_run(cls, run: Run) -> "KnownPlaces":
        """The map that the scans of a run show at its poses, which may be estimated ones."""
        poses, chosen = run.trajectory.poses, [0]
        for number in range(1, len(run)):
            length, turn = size_of(between(poses[chosen[-1]], poses[number]))
            if length >= KEY_DISTANCE or turn >= KEY_TURN:
                chosen.append(number)
        sight = Sight()
        keys = [sight.seen(run.scans_at(number), number) for number in chosen]
        return cls(run.world.name, keys, poses[chosen], np.array(chosen))

    @classmethod
    def from_world(cls, world: World) -> "KnownPlaces":
        """The map that a world is: what a laser that looks all around would see in it."""
        places = free_places(world, ROOM)
        area = len(np.unique(np.floor(places), axis=0))
        spacing = max(SPACING, np.sqrt(area / MOST_SCANS))
        _, first = np.unique(np.floor(places / spacing), axis=0, return_index=True)
        poses = np.column_stack([places[first], np.zeros(len(first))])
        step = 2.0 * np.pi / BEAMS
        lrf = LaserRangeFinder(-np.pi, np.pi - step, BEAMS, range_max=REACH)
        caster, sight = PlanarCaster(world), Sight()
        keys = [sight.seen(caster.cast(lrf, pose)) for pose in poses]
        return cls(world.name, keys, poses)

    @cached_property
    def _field(self) -> Field:
        return field_of(self.keys, self.poses)

    @cached_property
    def _free(self) -> Int:
        """Columns and rows (s, 2) of the free cells that are searched."""
        cells = self._field.cells == FREE
        stride = int(np.ceil(max(STRIDE, np.sqrt(cells.sum() / MOST_CELLS))))
        rows, columns = np.nonzero(cells[::stride, ::stride])
        return np.ascontiguousarray(stride * np.column_stack([columns, rows]))

    def search(self, scan: Key) -> list[Place]:
        """The places of the whole map where a scan fits, the best first."""
        peaks = self._peaks(scan) if len(self._free) else []
        found: list[Place] = []
        for candidate in (self.judged(scan, peak, LOOSE) for peak in peaks):
            if candidate and not any(
                same_place(candidate.match.pose, other.match.pose) for other in found
            ):
                found.append(candidate)
        return sorted(found, key=lambda each: -each.evidence)

    def _peaks(self, scan: Key) -> list[Float]:
        """The poses (3,) at which the hits of a scan meet most walls."""
        field, cells = self._field, self._free
        centre = np.array([field.left + 0.5 * CELL, field.low + 0.5 * CELL, 0.0])
        parts, scored = [], []
        for headings in np.array_split(np.arange(-np.pi, np.pi, STEP), PARTS):
            scores = window_scores(thin(scan.hits), field, centre, cells, headings)
            most = min(MOST_PEAKS, scores.size)
            best = np.argpartition(scores, scores.size - most, axis=None)[-most:]
            a, s = np.unravel_index(best, scores.shape)
            scored.append(scores[a, s])
            parts.append(np.column_stack([centre[:2] + CELL * cells[s], headings[a]]))
        ranked = np.concatenate(parts)[np.argsort(-np.concatenate(scored), kind="stable")]
        peaks: list[Float] = []
        while len(ranked) and len(peaks) < PEAKS:
            peak, *_ = ranked
            peaks.append(peak)
            x, y, turn = np.abs(between(peak, ranked)).T
            ranked = ranked[(np.hypot(x, y) > NEXT) | (turn > NEXT_TURN)]
        return peaks

    @cached_property
    def _seen(self) -> Float:
        """Where key scans were taken, and the middles of what they hit (k, 4) [m]."""
        middles = [_middle(key, pose) for key, pose in zip(self.keys, self.poses, strict=True)]
        return np.column_stack([self.poses[:, :2], np.array(middles)])

    def around(self, scan: Key, pose: Float) -> Int:
        """The key scans that see most of what a scan from a pose (3,) sees."""
        apart = np.abs(self._seen - [*pose[:2], *_middle(scan, pose)]).sum(axis=1)
        return np.argsort(apart, kind="stable")[:AROUND]

    def judged(self, scan: Key, guess: Float, prior: Float) -> Place | None:
        """The place near a guess (3,) where a scan fits, and the evidence for it."""
        near = self.around(scan, guess)
        around = Submap([self.keys[k] for k in near.tolist()], self.poses[near])
        match = around.match(scan, guess, prior)
        return None if match is None else around.place(scan, match)


def _middle(scan: Key, pose: Float) -> Float:
    """The middle (2,) of what a scan from a pose (3,) hit."""
    x, y = (scan.hits[name].mean() if len(scan.hits) else 0.0 for name in "xy")
    return compose(pose, np.array([x, y, 0.0]))[:2]
