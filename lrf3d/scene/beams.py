"""The beams of a scan as they are drawn: a few of them as lines, and all hit points.

All is in the film's frame. A mirror turns a beam: its straight path, which is as long as its range,
is folded there, and so has a leg from each mirror to the next.
"""

import numpy as np

from lrf3d.geometry import LEFT, Bool, Float, Int, cross, directions, lengths
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.scene.look import EMBER, LAMP, TRAIL_HEIGHT
from lrf3d.scene.shapes import Lines, Points, Soft, level_lines, single
from lrf3d.world import World

RANGE_COLOURS = np.array([[1.0, 0.95, 0.80], [1.0, 0.74, 0.42], [0.95, 0.50, 0.22]])
"""Colours of hit points from near to far."""

FARTHEST, _INTENSITIES = 30.0, (1e-4, 1.0)
"""Range [m] from which hit points have the last colour, and up to which beams without return light
the ground; and the intensities from which hit points have the last and the first colour where these
are shown, in steps of factors."""

_POINT_SIZE, _POINT_PIXELS, _MOST_LEGS, _LEAST_LEG = 0.08, (2.6, 8.0), 9, 1e-9
"""Diameter of a hit point [m], and its limits in a picture of 720 lines [pixels]; legs of a beam,
which casters turn up to eight times, and the shortest, as a share of the rest of its path: a beam
does not meet the wall that it has just left."""

_LAMP_BEAMS, _LAMP_SIDE, _LAMP_SHARE = 60, float(np.radians(28.0)), 0.33
"""About how many beams light the ground, the angle over which that ends at the sides of the field
of view [rad], and how far it goes, in the reach of beams."""


def turning_walls(world: World) -> Bool:
    """Which walls (n,) turn beams; glass turns little of the light, and lets the rest pass."""
    turning = [bool(one and one.mirrors and not one.passes) for one in world.materials]
    return np.array(turning or [False])[world.objects if turning else 0 * world.objects]


def draw_beams(
    scan: LaserScan,
    walls: Float,
    mirrors: Float,
    apex: Float,
    *,
    height: float,
    reach: float,
    by: str = "range",
) -> tuple[Lines, Points, Soft]:
    """A few beams of a scan, which fade to nothing at the reach [m], all its hits, and its lamp.

    The pose of the scan, walls (n, 4), those that turn beams (m, 4) and apex (2,) are in the film's
    frame. The apex is where the robot stands now, a little past that pose: beams follow the robot
    while points stay on their walls. Points are coloured by their range or intensity.
    """
    origin, hits = np.array([scan.pose.x, scan.pose.y]), scan.hits
    # A beam without return goes as far as it can be measured; one too near ends at once.
    far = scan.range_max if np.isfinite(scan.range_max) else 100.0
    ranges = np.where(hits, scan.ranges, np.where(scan.ranges < 0.0, 0.0, far))
    ends = origin + ranges[:, None] * beam_directions(scan.pose.theta, scan.angles)
    legs, beams, gone = folded(origin, ends, mirrors)
    last = np.zeros(len(ends), np.int64)
    last[beams] = np.arange(len(beams))
    final = legs[last[hits]]
    sides = _sides(final[:, :2], walls, scan.walls[hits])
    colours = single(np.insert(_point_colours(scan, by), 3, 1.0, axis=1))
    places = single(np.insert(final[:, 2:], 2, height, axis=1))
    points = Points(places, colours, single(sides), _POINT_SIZE, _POINT_PIXELS)
    legs[: len(ends), :2] = apex
    # Opacity of a beam at the robot, its width [pixels of 720 lines], and about how many are drawn:
    # more would run into one plane.
    strength, line_width, most_drawn = 0.40, 1.1, 30
    step = max(1, round(len(ends) / most_drawn))
    chosen = np.isin(beams, np.arange((len(ends) - 1) % step // 2, len(ends), step))
    chosen &= (gone < reach) | (gone == 0.0)
    starts, stops = np.hsplit(legs[chosen], 2)
    gone, length = gone[chosen, None], lengths(legs[chosen])[:, None]
    drawn = np.minimum(length, reach - gone)
    stops = starts + drawn / np.maximum(length, 1e-9) * (stops - starts)
    opacities = strength * (1.0 - np.hstack([gone, gone + drawn]) / reach)
    amber = np.full((len(gone), 3), EMBER)
    lines = level_lines(height, starts, stops, amber, opacities, line_width)
    return lines, points, _lamp(legs[: len(ends)], scan.angles, _LAMP_SHARE * reach)


def _lamp(legs: Float, angles: Float, reach: float) -> Soft:
    """Light on the ground along the first legs (n, 4) of beams at angles (n,) [rad].

    It fades to nothing at a reach [m], and at the sides of the field of view.
    """
    step = max(1, len(legs) // _LAMP_BEAMS)
    (starts, ends), angles = np.hsplit(legs[::step], 2), angles[::step]
    away = lengths(legs[::step])
    far = np.minimum(away, reach)
    ends = starts + (far / np.maximum(away, 1e-9))[:, None] * (ends - starts)
    edge = np.minimum(angles - angles.min(), angles.max() - angles) / _LAMP_SIDE
    bright = LAMP * (1.0 if np.ptp(angles) > 6.1 else np.clip(edge, 0.0, 1.0)) + 0.0 * far
    dim = bright * (1.0 - far / reach) ** 2
    # Each triangle stands at the robot's end of a beam, on the far ends of that and the one before.
    amber = np.tile([TRAIL_HEIGHT, *EMBER], (len(far) - 1, 1))
    corners = (starts[1:], bright[1:]), (ends[:-1], dim[:-1]), (ends[1:], dim[1:])
    rows = np.stack([np.column_stack([places, amber, light]) for places, light in corners], axis=1)
    return Soft(single(rows[..., :3]), single(rows[..., 3:]))


def _point_colours(scan: LaserScan, by: str) -> Float:
    """Colours (hits, 3) of the hits of a scan by their ranges or their intensities."""
    share = scan.ranges[scan.hits] / min(scan.range_max, FARTHEST)
    if by == "intensity" and scan.intensities is not None:
        dark, bright = np.log(_INTENSITIES)
        with np.errstate(divide="ignore"):
            share = (bright - np.log(scan.intensities[scan.hits])) / (bright - dark)
    steps = np.linspace(0.0, 1.0, len(RANGE_COLOURS))
    return np.column_stack([np.interp(share, steps, channel) for channel in RANGE_COLOURS.T])


def folded(origin: Float, ends: Float, mirrors: Float) -> tuple[Float, Int, Float]:
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
        gone = (gone + share * np.hypot(*path.T))[turned]
        going, start, end = going[turned], place[turned], end[turned]
        along = directions(mirrors[mirror[turned]])
        end = end - 2.0 * cross(along, end - start)[:, None] * along @ LEFT
    legs, beams, distances = (np.concatenate(column) for column in zip(*found, strict=True))
    return legs, beams, distances


def _first_crossing(starts: Float, ends: Float, mirrors: Float) -> tuple[Float, Int]:
    """The shares (n,) of paths from starts to ends (n, 2) up to a first mirror, and which it is.

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
    return np.asarray(along @ LEFT * np.where(numbers >= 0, toward, 0.0)[:, None])
