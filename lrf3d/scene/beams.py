"""The beams of a scan as they are drawn: their glow near the robot, single beams, and hit points.

All is in the film's frame. A mirror turns a beam: its straight path, which is as long as its range,
is folded there, and so has a leg from each mirror to the next.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Bool, Float, Int, cross, directions, lengths
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.scene.shapes import Lines, Points, Soft, level_lines, single
from lrf3d.scene.structures import Structures
from lrf3d.world import World

_COLOUR, _STRENGTH, _WIDTH, _DRAWN = (1.0, 0.36, 0.26), 0.55, 1.1, 30
"""Colour of a single beam, its opacity at the robot, its width [pixels of 720 lines], and about how
many are drawn: more would run into one red."""

_REACH, _REACH_INDOOR, _SHARE_INDOOR = 42.0, 14.0, 0.9
"""Range [m] at which beams have faded to nothing, as farther ones would only tint the street; the
same in rooms, where it is at most this share of the world's diagonal: small rooms would be red."""

_GLOW_COLOUR, _GLOW, _GLOW_INDOOR, _GLOW_REACH = (1.00, 0.30, 0.20), 0.20, 0.17, 4.0
"""Colour of the glow of the beams, its opacity at the robot, and the range [m] at which it has
faded: beyond, the hits say what the robot sees."""

_GLOW_OVER_ROBOT = 0.45
"""What is left of its opacity over the robot, whose colours stay its own."""

_FADING, _FADED = 0.25, 0.14
"""The share of the beams at both ends of a scan that fade in, and what is left of their opacity at
the very ends: a fan of half a turn would end in a hard line across the picture."""

RANGE_COLOURS = np.array(
    [
        [1.00, 0.93, 0.50],
        [1.00, 0.70, 0.20],
        [1.00, 0.42, 0.14],
        [0.90, 0.20, 0.30],
        [0.68, 0.20, 0.62],
    ]
)
"""Colours of hit points from near to far."""

_FARTHEST, _INTENSITIES = 30.0, (1e-4, 1.0)
"""Range [m] from which hit points have the last colour; and the intensities from which they have
the last and the first where these are shown, in steps of factors."""

_POINT_SIZE, _POINT_PIXELS = 0.08, (2.6, 8.0)
"""Diameter of a hit point [m], and the smallest and largest in a picture of 720 lines [pixels]."""

_MOST_LEGS, _LEAST_LEG = 9, 1e-9
"""Legs of a beam: casters turn it up to eight times; and the shortest, as a share of the rest of
its path: a beam does not meet again what it leaves."""

_LEFT = np.array([[0.0, 1.0], [-1.0, 0.0]])
"""Turns rows of vectors to the left by a right angle."""


def turning_walls(world: World) -> Bool:
    """Which walls (n,) turn beams; glass turns little of the light, and lets the rest pass."""
    if not world.materials:
        return np.zeros(len(world.segments), dtype=bool)
    turning = [bool(one and one.mirrors and not one.passes) for one in world.materials]
    return np.array(turning)[world.objects]


def beam_reach(range_max: float, structures: Structures) -> float:
    """Range [m] at which beams have faded to nothing."""
    if not structures.indoor or not len(structures.places):
        return min(range_max, _REACH)
    across = float(np.hypot(*np.ptp(structures.places, axis=0)))
    return min(range_max, _REACH_INDOOR, max(_SHARE_INDOOR * across, 1.0))


@dataclass(frozen=True, eq=False, slots=True)
class DrawnBeams:
    """One scan, ready to be drawn."""

    legs: Float
    """(l, 4) the legs of the beams, the first of each beam before all others [m]."""
    beams: Int
    """(l,) the beam of each."""
    gone: Float
    """(l,) how far the beam has gone where it begins [m]."""
    shares: Float
    """(beams,) what of their opacity beams have: those at the ends of a scan fade in."""
    points: Float
    """(hits, 2) the reflection points [m]."""
    sides: Float
    """(hits, 2) where the wall of each looks; 0 where no wall is known."""
    ranges: Float
    """(hits,) their measured ranges [m]."""
    intensities: Float | None
    """(hits,) their intensities, where they are known."""

    @classmethod
    def from_scan(
        cls, scan: LaserScan, walls: Float, apex: Float, turning: Bool | None = None
    ) -> "DrawnBeams":
        """Make beams of a scan whose pose, like walls (n, 4) and apex (2,), is in the film's frame.

        The apex is where the robot stands now, a little past the pose of the scan: the beams then
        follow the robot while the points stay on their walls. Some walls (n,) turn beams.
        """
        origin, hits = np.array([scan.pose.x, scan.pose.y]), scan.hits
        # A beam without return goes as far as it can be measured; one too near ends at once.
        far = scan.range_max if np.isfinite(scan.range_max) else 100.0
        ranges = np.where(hits, scan.ranges, np.where(scan.ranges < 0.0, 0.0, far))
        ends = origin + ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
        mirrors = walls[:0] if turning is None else walls[turning]
        legs, beams, gone = _folded(origin, ends, mirrors)
        last = np.zeros(len(ends), np.int64)
        last[beams] = np.arange(len(beams))
        last = last[hits]
        sides = _sides(legs[last, :2], walls, scan.walls[hits])
        points = legs[last, 2:].copy()
        legs[: len(ends), :2] = apex
        lights = None if scan.intensities is None else scan.intensities[hits]
        shares = _fading_ends(scan.angles)
        return cls(legs, beams, gone, shares, points, sides, scan.ranges[hits], lights)

    def glow(self, height: float, *, indoor: bool) -> Soft:
        """The glow of the beams near the robot: triangles between them."""
        strength, first = _GLOW_INDOOR if indoor else _GLOW, self.legs[: len(self.shares)]
        reached = np.minimum(lengths(first), _GLOW_REACH)
        ends = _cut(first, reached)[:, 2:]
        opacities = strength * self.shares * (1.0 - reached / _GLOW_REACH)
        corners = np.full((max(len(ends) - 1, 0), 3, 3), height)
        colours = np.empty((len(corners), 3, 4))
        colours[..., :3] = _GLOW_COLOUR
        corners[:, 0, :2] = first[1:, :2]
        colours[:, 0, 3] = strength * _GLOW_OVER_ROBOT * self.shares[1:]
        corners[:, 1, :2], colours[:, 1, 3] = ends[:-1], opacities[:-1]
        corners[:, 2, :2], colours[:, 2, 3] = ends[1:], opacities[1:]
        return Soft(single(corners), single(colours))

    def single(self, height: float, reach: float) -> Lines:
        """A few beams, paler with the range [m] and gone at the reach [m]."""
        count = len(self.shares)
        step = max(1, round(count / _DRAWN))
        chosen = np.isin(self.beams, np.arange((count - 1) % step // 2, count, step))
        chosen &= (self.gone < reach) | (self.gone == 0.0)
        legs, gone = self.legs[chosen], self.gone[chosen]
        drawn = np.minimum(lengths(legs), reach - gone)
        left = 1.0 - np.column_stack([gone, gone + drawn]) / reach
        opacities = _STRENGTH * self.shares[self.beams[chosen], None] * left
        starts, ends = np.hsplit(_cut(legs, drawn), 2)
        colours = np.full((len(legs), 3), _COLOUR)
        return level_lines(height, starts, ends, colours, opacities, _WIDTH)

    def hit_points(self, height: float, range_max: float, *, by: str = "range") -> Points:
        """The hit points, coloured by their ranges or their intensities."""
        share = self.ranges / min(range_max, _FARTHEST)
        if by == "intensity" and self.intensities is not None:
            dark, bright = np.log(_INTENSITIES)
            with np.errstate(divide="ignore"):
                share = (bright - np.log(self.intensities)) / (bright - dark)
        steps = np.linspace(0.0, 1.0, len(RANGE_COLOURS))
        mixed = [np.interp(share, steps, channel) for channel in RANGE_COLOURS.T]
        colours = np.column_stack([*mixed, np.ones(len(share))])
        places = np.column_stack([self.points, np.full(len(self.points), height)])
        return Points(
            single(places), single(colours), single(self.sides), _POINT_SIZE, _POINT_PIXELS
        )


def _cut(legs: Float, wanted: Float) -> Float:
    """Legs (l, 4) as long as wanted (l,) [m]."""
    share = wanted / np.maximum(lengths(legs), 1e-9)
    cut = legs.copy()
    cut[:, 2:] = legs[:, :2] + share[:, None] * (legs[:, 2:] - legs[:, :2])
    return cut


def _fading_ends(angles: Float) -> Float:
    """What of the opacity of beams at angles (beams,) [rad] is left."""
    count = len(angles)
    if count < 2 or (angles[1] - angles[0]) * (count + 1) > 2.0 * np.pi:
        # All round there is no end.
        return np.ones(count)
    place = np.linspace(0.0, 1.0, count)
    share = np.clip(np.minimum(place, 1.0 - place) / _FADING, 0.0, 1.0)
    return np.asarray(_FADED + (1.0 - _FADED) * share * share * (3.0 - 2.0 * share))


def _folded(origin: Float, ends: Float, mirrors: Float) -> tuple[Float, Int, Float]:
    """The legs (l, 4) of beams from an origin (2,) to ends (beams, 2), folded at mirrors (m, 4).

    Returns also the beam (l,) of each, and how far it has gone where the leg begins (l,) [m].
    """
    going, start, end = np.arange(len(ends)), np.tile(origin, (len(ends), 1)), ends
    gone = np.zeros(len(ends))
    found: list[tuple[Float, Int, Float]] = []
    while len(going) and len(found) < _MOST_LEGS:
        share, mirror = _first_crossing(start, end, mirrors)
        path = end - start
        place = start + share[:, None] * path
        found.append((np.hstack([start, place]), going, gone))
        turned = mirror >= 0
        gone = (gone + share * np.hypot(path[:, 0], path[:, 1]))[turned]
        going, start, end = going[turned], place[turned], end[turned]
        along = directions(mirrors[mirror[turned]])
        end = end - 2.0 * cross(along, end - start)[:, None] * along @ _LEFT
    legs, beams, distances = (np.concatenate(column) for column in zip(*found, strict=True))
    return legs, beams, distances


def _first_crossing(starts: Float, ends: Float, mirrors: Float) -> tuple[Float, Int]:
    """Which share (n,) of the paths from starts to ends (n, 2) leads to which mirror.

    The share is 1 and the mirror −1 where a path meets none.
    """
    path, along = (ends - starts)[:, None], mirrors[:, 2:] - mirrors[:, :2]
    offset = mirrors[:, :2] - starts[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        turn = cross(path, along)
        share, place = cross(offset, along) / turn, cross(offset, path) / turn
    meets = (share > _LEAST_LEG) & (share < 1.0) & (place >= 0.0) & (place <= 1.0)
    share = np.column_stack([np.ones(len(starts)), np.where(meets, share, np.inf)])
    nearest = np.argmin(share, axis=1)
    return share[np.arange(len(share)), nearest], nearest - 1


def _sides(origins: Float, walls: Float, numbers: Int) -> Float:
    """Normals (n, 2) of walls by number, towards where beams come from (n, 2); 0 for −1."""
    if not len(walls):
        return np.zeros_like(origins)
    along = walls[numbers, 2:] - walls[numbers, :2]
    toward = np.sign(cross(along, origins - walls[numbers, :2]))
    return np.asarray(along @ _LEFT * np.where(numbers >= 0, toward, 0.0)[:, None])
