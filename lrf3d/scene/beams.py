"""The beams of a scan as they are drawn: the fan, single beams, hit points and the trace on walls.

All arrays are in the film's frame.
"""

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
from lrf3d.scene.turns import Turns


@dataclass(frozen=True, eq=False)
class DrawnBeams:
    """One scan, ready to be drawn.

    Args:
        apex: (2,) where the beams come from [m].
        ends: (beams, 2) where they end, or are first turned [m].
        points: (hits, 2) the reflection points [m].
        point_ranges: (hits,) their measured ranges [m].
        point_lights: (hits,) their intensities, or None.
        sides: (hits, 2) where the face of the wall looks that each point lies on; 0 where no wall
            is known.
        beam_angle: Angle from one beam to the next [rad].
        legs: (l, 4) the paths of beams after mirrors turned them [m].
        leg_beams: (l,) the beam of each of these.
    """

    apex: Float
    ends: Float
    points: Float
    point_ranges: Float
    point_lights: Float | None
    sides: Float
    beam_angle: float
    legs: Float
    leg_beams: Int

    @classmethod
    def from_scan(
        cls, scan: LaserScan, walls: Float, apex: Float, turning: Bool | None = None
    ) -> "DrawnBeams":
        """Make beams of a scan whose pose, like walls (n, 4) and apex (2,), is in the film's frame.

        The apex is where the robot stands now, a little past the pose of the scan: the beams then
        follow the robot while the points stay on their walls. Some walls (n,) turn beams.
        """
        origin = np.array([scan.pose.x, scan.pose.y])
        # A beam without return goes as far as it can be measured; one too near ends at once.
        far = scan.range_max if np.isfinite(scan.range_max) else 100.0
        ranges = np.where(scan.hits, scan.ranges, np.where(scan.ranges < 0.0, 0.0, far))
        ends = origin + ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
        turns = Turns.of(origin, ends, walls[:0] if turning is None else walls[turning])
        points = turns.last[scan.hits]
        return cls(
            apex,
            turns.first,
            points,
            scan.ranges[scan.hits],
            None if scan.intensities is None else scan.intensities[scan.hits],
            _sides(turns.starts[scan.hits], points, walls, scan.walls[scan.hits]),
            float(scan.angles[1] - scan.angles[0]) if len(scan.angles) > 1 else 0.0,
            turns.legs,
            turns.beams,
        )

    @property
    def ranges(self) -> Float:
        """How far the ends are from the apex (beams,) [m]."""
        return np.asarray(np.hypot(*(self.ends - self.apex).T))

    def glow(self, height: float, *, indoor: bool) -> Soft:
        """The glow of the beams near the robot: triangles between them."""
        ranges, shares = self.ranges, fading_ends(len(self.ends), self.beam_angle)
        strength = FAN_STRENGTH_INDOOR if indoor else FAN_STRENGTH
        reached = np.minimum(ranges, FAN_REACH)
        ends = self._at(reached, ranges)
        opacities = strength * shares * (1.0 - reached / FAN_REACH)
        corners = np.full((max(len(ends) - 1, 0), 3, 3), height)
        colours = np.empty((len(corners), 3, 4))
        colours[..., :3] = FAN_COLOUR
        # Over the robot itself it is pale: its colours stay its own.
        corners[:, 0, :2], colours[:, 0, 3] = self.apex, strength * FAN_SHARE_AT_ROBOT * shares[1:]
        corners[:, 1, :2], colours[:, 1, 3] = ends[:-1], opacities[:-1]
        corners[:, 2, :2], colours[:, 2, 3] = ends[1:], opacities[1:]
        return Soft(single(corners), single(colours))

    def single(self, height: float, reach: float) -> Lines:
        """A few beams, paler with the range [m] and gone at the reach [m]."""
        step = max(1, round(len(self.ends) / BEAMS_DRAWN))
        chosen = np.arange((len(self.ends) - 1) % step // 2, len(self.ends), step)
        ranges, shares = self.ranges, fading_ends(len(self.ends), self.beam_angle)
        drawn = np.minimum(ranges, reach)
        ends = self._at(drawn, ranges)[chosen]
        left = np.column_stack([np.ones(len(ends)), 1.0 - drawn[chosen] / reach])
        opacities = BEAM_STRENGTH * shares[chosen, None] * left
        legs = np.isin(self.leg_beams, chosen)
        starts = np.broadcast_to(self.apex, ends.shape)
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
            # From bright to dark, by factors.
            dark, bright = np.log(INTENSITY_COLOURS)
            with np.errstate(divide="ignore"):
                share = (bright - np.log(self.point_lights)) / (bright - dark)
        place = np.clip(share, 0.0, 1.0) * (len(RANGE_COLOURS) - 1)
        steps = np.arange(len(RANGE_COLOURS))
        mixed = [np.interp(place, steps, channel) for channel in RANGE_COLOURS.T]
        colours = np.column_stack([*mixed, np.ones(len(place))])
        places = np.column_stack([self.points, np.full(len(self.points), height)])
        return Points(single(places), single(colours), single(self.sides), POINT_SIZE, POINT_PIXELS)

    def _at(self, wanted: Float, ranges: Float) -> Float:
        """Points at wanted ranges (beams,) on the lines from the apex to the ends."""
        return self.apex + (self.ends - self.apex) * (wanted / np.maximum(ranges, 1e-9))[:, None]


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


def _sides(origin: Float, points: Float, walls: Float, numbers: Int) -> Float:
    """Normals (n, 2) of walls by number, towards where beams come from (n, 2); 0 for −1."""
    if not len(walls):
        return np.zeros_like(points)
    along = walls[numbers, 2:] - walls[numbers, :2]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    toward = np.sign(np.einsum("ij,ij->i", normal, origin - walls[numbers, :2]))
    return np.asarray(normal * np.where(numbers >= 0, toward, 0.0)[:, None])
