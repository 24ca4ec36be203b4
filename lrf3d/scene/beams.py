"""The beams of a scan as they are drawn: the fan, single beams, hit points and the trace on walls.

All arrays are in the film's frame.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Float, Int, lengths
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.scene.look import (
    BEAM_COLOUR,
    BEAM_REACH,
    BEAM_REACH_INDOOR,
    BEAM_SHARE_INDOOR,
    BEAM_STRENGTH,
    BEAM_WIDTH,
    BEAMS_DRAWN,
    FAN_COLOUR,
    FAN_END_SHARE,
    FAN_ENDS,
    FAN_REACH,
    FAN_SHARE_AT_ROBOT,
    FAN_STRENGTH,
    FAN_STRENGTH_INDOOR,
    FARTHEST_COLOUR,
    INTENSITY_COLOURS,
    POINT_PIXELS,
    POINT_SIZE,
    RANGE_COLOURS,
    TURNED_SHARE,
)
from lrf3d.scene.shapes import Lines, Points, Soft, single
from lrf3d.scene.structures import Structures
from lrf3d.scene.turns import Turns, WallOptics

_JOINED_GAP = 0.6
"""Neighbouring hits farther apart [m] than this, of which no wall is known, are not joined."""

_WEDGE = 0.1
"""Widest triangle of the fan [rad]: its chord is off the circle by a thousandth of the range."""

Carry = Callable[[Float, Bool, float], Float]
"""Moves ends (beams, 2), of which some are loose (beams,), since a time [s] to where they are."""


def _stay(ends: Float, loose: Bool, since: float) -> Float:
    return ends


@dataclass(frozen=True, eq=False)
class DrawnBeams:
    """One scan, ready to be drawn.

    Args:
        apex: (2,) where the beams come from [m].
        ends: (beams, 2) where they end as seen from the apex [m].
        ranges: (beams,) how far that is [m].
        points: (hits, 2) the reflection points [m].
        point_ranges: (hits,) their measured ranges [m].
        point_lights: (hits,) their intensities, or None.
        joined: (beams − 1,) whether the beam and the next ended on one wall.
        hits: (beams,) which beams returned.
        sides: (hits, 2) where the face of the wall looks that each point lies on; 0 where no wall
            is known.
        beam_angle: Angle from one beam to the next [rad].
        legs: (l, 4) the ways of beams after mirrors turned them [m].
        leg_beams: (l,) the beam of each of these.
    """

    apex: Float
    ends: Float
    ranges: Float
    points: Float
    point_ranges: Float
    point_lights: Float | None
    joined: Bool
    hits: Bool
    sides: Float
    beam_angle: float
    legs: Float
    leg_beams: Int

    @classmethod
    def from_scan(
        cls,
        scan: LaserScan,
        walls: Float,
        objects: Int,
        apex: Float,
        carry: Carry = _stay,
        optics: WallOptics | None = None,
    ) -> "DrawnBeams":
        """Make beams of a scan whose pose, like walls (n, 4) and apex (2,), is in the film's frame.

        The apex is where the robot stands now, a little past the pose of the scan: the beams then
        follow the robot while the points stay on their walls, and move with what moves: ends
        that lie on no known wall are carried on. Mirrors turn beams, and glass lets them pass.
        """
        origin = np.array([scan.pose.x, scan.pose.y])
        # A beam without return goes as far as it can be measured; one too near ends at once.
        far = scan.range_max if np.isfinite(scan.range_max) else 100.0
        ranges = np.where(scan.hits, scan.ranges, np.where(scan.ranges < 0.0, 0.0, far))
        ends = origin + ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
        known = scan.walls >= 0
        ends = carry(ends, scan.hits & ~known, scan.time)
        hidden, starts = np.ones(len(walls), np.bool_), np.broadcast_to(origin, ends.shape)
        legs, leg_beams = np.empty((0, 4)), np.empty(0, np.int64)
        first, turned = ends, np.full(len(ends), -1)
        if optics is not None:
            hidden = ~optics.clear
            if optics.mirrors.any():
                turns = Turns.of(origin, ends, walls[optics.mirrors])
                first, ends, starts, turned, legs, leg_beams = turns
        close = np.hypot(*(ends[1:] - ends[:-1]).T) < _JOINED_GAP
        same = np.where(known[1:] & known[:-1], scan.walls[1:] == scan.walls[:-1], close)
        joined = scan.hits[1:] & scan.hits[:-1] & same & (turned[1:] == turned[:-1])
        points = ends[scan.hits]
        sides = _sides(starts[scan.hits], points, walls, scan.walls[scan.hits])
        ends = first
        if np.hypot(*(apex - origin)) > 1e-6:
            if known.any():
                met = np.zeros(int(objects.max()) + 1, dtype=bool)
                met[objects[scan.walls[known]]] = True
                near = met[objects] & hidden
                ends = _seen_from(apex, ends, walls[near])
            else:
                apex = origin
        reached = np.hypot(*(ends - apex).T)
        step = float(scan.angles[1] - scan.angles[0]) if len(scan.angles) > 1 else 0.0
        measured = scan.ranges[scan.hits]
        lights = None if scan.intensities is None else scan.intensities[scan.hits]
        return cls(
            apex, ends, reached, points, measured, lights, joined, scan.hits, sides, step, legs,
            leg_beams,
        )  # fmt: skip

    @property
    def shares(self) -> Float:
        """What of the opacity of each beam (beams,) is left towards the ends of the fan."""
        return fading_ends(len(self.ends), self.beam_angle)

    def glow(self, height: float, *, indoor: bool) -> Soft:
        """The glow of the beams near the robot: triangles between them."""
        both_open = ~self.hits[:-1] & ~self.hits[1:]
        # Between two beams that ended on different walls it goes as far as the shorter.
        kind = np.where(self.joined, 1, np.where(both_open, 2, 0))
        start = _wedges(kind, self.beam_angle)
        sides = np.stack([start, np.append(start, len(kind))[1:]])
        ranges = self.ranges[sides]
        reached = np.where(kind[start] > 0, ranges, ranges.min(axis=0, initial=np.inf))
        reached = np.minimum(reached, FAN_REACH)
        corners = np.full((len(start), 3, 3), height)
        corners[:, 0, :2] = self.apex
        colours = np.empty((len(start), 3, 4))
        colours[..., :3] = FAN_COLOUR
        strength, shares = FAN_STRENGTH_INDOOR if indoor else FAN_STRENGTH, self.shares[sides]
        # Over the robot itself it is pale: its colours stay its own.
        colours[:, 0, 3] = strength * FAN_SHARE_AT_ROBOT * shares.mean(axis=0)
        for side, beams in enumerate(sides):
            ends = self._at(self.ends[beams], reached[side, :, None], self.ranges[beams])
            corners[:, 1 + side, :2] = ends
            colours[:, 1 + side, 3] = strength * shares[side] * (1.0 - reached[side] / FAN_REACH)
        return Soft(single(corners), single(colours))

    def single(self, height: float, reach: float) -> Lines:
        """A few beams, paler with the range [m] and gone at the reach [m]."""
        chosen = drawn_beams(len(self.ends))
        ranges = np.minimum(self.ranges[chosen], reach)
        ends = self._at(self.ends[chosen], ranges[:, None], self.ranges[chosen])
        starts = np.broadcast_to(self.apex, ends.shape)
        left = np.column_stack([np.ones(len(ends)), 1.0 - ranges / reach])
        opacities = BEAM_STRENGTH * self.shares[chosen, None] * left
        legs = np.isin(self.leg_beams, chosen)
        starts = np.concatenate([starts, self.legs[legs, :2]])
        ends = np.concatenate([ends, self.legs[legs, 2:]])
        faint = TURNED_SHARE * BEAM_STRENGTH * self._left_of_legs(reach)[legs]
        opacities = np.concatenate([opacities, faint])
        colours = np.full((len(ends), 3), BEAM_COLOUR)
        return lines_at(height, starts, ends, colours, opacities, BEAM_WIDTH)

    def _left_of_legs(self, reach: float) -> Float:
        """What (l, 2) of their opacity legs have left at both ends: none from a reach [m] on."""
        ends, lengths_of = np.empty(len(self.legs)), lengths(self.legs)
        gone = self.ranges.copy()
        for leg, (beam, length) in enumerate(zip(self.leg_beams, lengths_of, strict=True)):
            gone[beam] += length
            ends[leg] = gone[beam]
        far = np.column_stack([ends - lengths_of, ends])
        return np.asarray(np.clip(1.0 - far / reach, 0.0, 1.0))

    def hit_points(self, height: float, range_max: float, *, by: str = "range") -> Points:
        """The hit points, coloured by their ranges or their intensities."""
        share = np.clip(self.point_ranges / min(range_max, FARTHEST_COLOUR), 0.0, 1.0)
        if by == "intensity" and self.point_lights is not None:
            share = darkness(self.point_lights)
        place = share * (len(RANGE_COLOURS) - 1)
        colours = np.ones((len(self.points), 4))
        for channel in range(3):
            colours[:, channel] = np.interp(
                place, np.arange(len(RANGE_COLOURS)), RANGE_COLOURS[:, channel]
            )
        places = np.column_stack([self.points, np.full(len(self.points), height)])
        return Points(single(places), single(colours), single(self.sides), POINT_SIZE, POINT_PIXELS)

    def _at(self, ends: Float, wanted: Float, ranges: Float) -> Float:
        """Points at wanted ranges (n, 1) on the way from the apex to ends (n, 2)."""
        return self.apex + (ends - self.apex) * (wanted / np.maximum(ranges, 1e-9)[:, None])


def darkness(intensities: Float) -> Float:
    """Places (…) among the colours of hit points of intensities: 0 bright, 1 dark, by factors."""
    dark, bright = np.log(INTENSITY_COLOURS)
    with np.errstate(divide="ignore"):
        place = (bright - np.log(intensities)) / (bright - dark)
    return np.asarray(np.clip(place, 0.0, 1.0))


def fading_ends(count: int, beam_angle: float) -> Float:
    """What of the opacity of beams (count,) is left that lie at an angle [rad] from each other."""
    if count < 2 or beam_angle * (count + 1) > 2.0 * np.pi:
        # All round there is no end.
        return np.ones(count)
    place = np.linspace(0.0, 1.0, count)
    share = np.clip(np.minimum(place, 1.0 - place) / FAN_ENDS, 0.0, 1.0)
    smooth = share * share * (3.0 - 2.0 * share)
    return np.asarray(FAN_END_SHARE + (1.0 - FAN_END_SHARE) * smooth)


def beam_reach(range_max: float, structures: Structures) -> float:
    """Range [m] at which beams have faded to nothing."""
    if not structures.indoor or not len(structures.places):
        return min(range_max, BEAM_REACH)
    across = float(np.hypot(*np.ptp(structures.places, axis=0)))
    return min(range_max, BEAM_REACH_INDOOR, max(BEAM_SHARE_INDOOR * across, 1.0))


def drawn_beams(count: int) -> Int:
    """Which of a number of beams are drawn as single lines, evenly over the scan."""
    step = max(1, round(count / BEAMS_DRAWN))
    return np.arange((count - 1) % step // 2, count, step)


def lines_at(
    height: float,
    starts: Float,
    ends: Float,
    colours: Float,
    opacities: Float,
    width: float,
    *,
    hidden: bool = False,
) -> Lines:
    """Lines from (n, 2) to (n, 2) at a height [m]."""
    level = np.full((len(starts), 1), height)
    return Lines(
        single(np.concatenate([starts, level], axis=1)),
        single(np.concatenate([ends, level], axis=1)),
        single(colours),
        single(opacities),
        np.zeros((len(starts), 2), np.float32),
        width,
        hidden,
    )


def _wedges(kind: Int, beam_angle: float) -> Int:
    """The beams that triangles of the fan begin at: beams that end on one wall share some.

    Many narrow triangles take longer to draw than a few wide ones of the same area.
    """
    if not len(kind):
        return np.zeros(0, dtype=np.int64)
    most = max(1, int(_WEDGE / beam_angle)) if beam_angle > 0.0 else 1
    changes = np.append(True, (kind[1:] != kind[:-1]) | (kind[1:] == 0))
    begins = np.flatnonzero(changes)
    place = np.arange(len(kind)) - begins[np.cumsum(changes) - 1]
    return np.flatnonzero(changes | (place % most == 0))


def _sides(origin: Float, points: Float, walls: Float, numbers: Int) -> Float:
    """Normals (n, 2) of walls by number, towards where beams come from (n, 2); 0 for −1."""
    if not len(walls):
        return np.zeros_like(points)
    along = walls[numbers, 2:] - walls[numbers, :2]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    toward = np.sign(np.einsum("ij,ij->i", normal, origin - walls[numbers, :2]))
    return np.asarray(normal * np.where(numbers >= 0, toward, 0.0)[:, None])


def _seen_from(apex: Float, ends: Float, walls: Float) -> Float:
    """The ends (m, 2), drawn nearer where one of the walls (n, 4) hides them from the apex (2,)."""
    way = ends - apex
    offset = walls[:, :2] - apex
    along = walls[:, 2:] - walls[:, :2]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = way[:, 0, None] * along[:, 1] - way[:, 1, None] * along[:, 0]
        share = (offset[:, 0] * along[:, 1] - offset[:, 1] * along[:, 0]) / crossing
        place = (offset[:, 0] * way[:, 1, None] - offset[:, 1] * way[:, 0, None]) / crossing
    blocked = (share > 0.0) & (share < 0.995) & (place >= 0.0) & (place <= 1.0)
    nearest = np.min(np.where(blocked, share, 1.0), axis=1, initial=1.0)
    return np.asarray(apex + way * nearest[:, None])
