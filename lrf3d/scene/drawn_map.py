"""The map as it is drawn: lines along the mapped walls, and ghosts where it has no wall."""

import sys
from dataclasses import dataclass

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.run import Run
from lrf3d.scene.look import PALE_FROM, PALE_OBJECT, object_tints
from lrf3d.scene.shapes import Lines, Soft, level_lines, single
from lrf3d.scene.stage.structures import Structures


@dataclass(frozen=True, eq=False, slots=True)
class DrawnMap:
    """A map as it is drawn, each object in its colour."""

    segments: Float
    """(m, 4) its segments in the film's frame [m]."""
    colours: Float
    """(m, 3) red, green, blue in 0…1."""

    @classmethod
    def from_snapshot(cls, run: Run, number: int, structures: Structures) -> "DrawnMap":
        """Take a map snapshot of a run; −1 is the empty map before the first."""
        if number < 0:
            return cls(np.zeros((0, 4)), np.zeros((0, 3)))
        segments = run.maps[number].segments - np.tile(structures.origin, 2)
        return cls(segments, _colours(run, run.lasting_objects[number]))

    def lines(self, height: float, width: float) -> Lines:
        """Its segments as lines at a height [m], of a width [pixels]."""
        opacities = np.ones((len(self.segments), 2))
        starts, ends = np.hsplit(self.segments, 2)
        return level_lines(height, starts, ends, self.colours, opacities, width)

    def bands(self) -> Lines:
        """Its segments along the walls."""
        # Height of the map's lines along the walls, above the beams, how thick they are [m], and at
        # least [pixels of 720 lines]: they show from far away.
        band, band_thick, band_pixels = 0.70, 0.06, 3.0
        return self.lines(band, band_pixels)._replace(thick=band_thick)

    def tints(self, places: Float, tolerance: float) -> tuple[Float, Bool]:
        """Its colours (n, 3) at places (n, 2), and whether (n,) it is within a tolerance [m]."""
        tints, near = np.zeros((len(places), 3)), np.zeros(len(places), dtype=bool)
        if len(self.segments):
            tree = shapely.STRtree(shapely.linestrings(self.segments.reshape(-1, 2, 2)))
            found, segment = tree.query_nearest(
                shapely.points(places), max_distance=tolerance, all_matches=False
            )
            tints[found], near[found] = self.colours[segment], True
        return tints, near

    def ghosts(self, structures: Structures, tolerance: float) -> Soft:
        """What of its segments lies on no wall within a tolerance [m], standing free."""
        # Height of walls of the map that the world lacks [m], opacity at their foot, length of
        # pieces [m], and the most of a segment: some are as long as the world.
        ghost_height, ghost_strength, ghost_step, most_pieces = 1.8, 0.55, 0.4, 500
        pieces = np.ceil(lengths(self.segments) / ghost_step)
        count = np.clip(pieces, 1, most_pieces).astype(int)
        owner = np.repeat(np.arange(len(count)), count)
        number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        start, end = np.hsplit(self.segments[owner], 2)
        low, middle, high = (
            start + ((number + step) / count[owner])[:, None] * (end - start)
            for step in (0.0, 0.5, 1.0)
        )
        on_walls = {"predicate": "dwithin", "distance": tolerance}
        near, _ = structures.tree.query(shapely.points(middle), **on_walls)
        loose = np.setdiff1d(np.arange(len(owner)), near)
        a, b = (np.insert(place[loose], 2, 0.0, axis=1) for place in (low, high))
        up = np.array([0.0, 0.0, ghost_height])
        corners = np.stack([a, b, b + up, a, b + up, a + up], axis=1).reshape(-1, 3, 3)
        strength = ghost_strength * np.tile([1.0, 1.0, 0.0, 1.0, 0.0, 0.0], len(loose))
        tints = np.repeat(self.colours[owner[loose]], 6, axis=0)
        return Soft(single(corners), single(np.column_stack([tints, strength]).reshape(-1, 3, 4)))


def _colours(run: Run, objects: Int) -> Float:
    """Colours (m, 3) of objects of a run's map: their numbers last while it grows.

    What most of the last map belongs to, such as the walls of a house, is pale.
    """
    last = run.snapshot_after(sys.maxsize)
    colours = object_tints(objects, dark=True)
    sums = np.bincount(run.lasting_objects[last], weights=lengths(run.maps[last].segments))
    if sums.max(initial=0.0) > PALE_FROM * sums.sum():
        colours[objects == int(sums.argmax())] = PALE_OBJECT
    return colours
