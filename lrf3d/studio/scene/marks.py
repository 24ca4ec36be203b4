"""Marks over a world: the beams of a scan, the map, and the trails of the robot.

A scan, a map snapshot, the keys of a drive and the estimate of a run enter; lines, points and
translucent faces in the film's frame leave.
"""

import sys
from dataclasses import dataclass

import numpy as np
import shapely

from lrf3d.geometry.lines import LEFT, Bool, Float, Int, cross, directions, lengths
from lrf3d.laser import LaserScan, beam_directions
from lrf3d.robot import EstimatedTrajectory
from lrf3d.studio.scene import look
from lrf3d.studio.scene.shapes import Lines, Points, Soft, level_lines, single
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.stage.exposure import Exposure
from lrf3d.studio.scene.stage.structures import FARTHEST, SIGHT_DISTANCE, Structures, folded
from lrf3d.studio.scene.timeline import DriveKeys, Timeline, interpolated

# Time in which the trail fades to its lasting opacity [s of the film].
TRAIL_FADE = 15.0

# Colours of hit points from near to far.
RANGE_COLOURS = np.array([look.rgb(code) for code in ("#fff2cc", "#ffbd6b", "#f28038")])

# Intensity at which hit points have the last colour, where intensities are shown; at 1 they have
# the first, and between colours change evenly with the logarithm.
_DARKEST_HIT = 1e-4

# Diameter of a hit point [m].
_POINT_SIZE = 0.08

# Its smallest and largest diameter [pixels of 720 lines].
_POINT_PIXELS = (2.6, 8.0)

# Opacity of a beam at the robot.
_BEAM_STRENGTH = 0.40

# About how many beams are drawn: more would run into one plane.
_DRAWN_BEAMS = 30

# About how many beams light the ground.
_LAMP_BEAMS = 60

# Angle over which that light ends at the sides of the field of view [rad].
_LAMP_SIDE = float(np.radians(28.0))

# Field of view from which on the light has no sides [rad]: nearly a full turn.
_AROUND = 6.1

# Reach of that light, in that of beams.
_LAMP_SHARE = 0.33

# Height of the map's lines along the walls, above the beams [m].
_BAND = 0.70

# Height of these lines from edge to edge [m].
_BAND_THICK = 0.06

# Height of walls of the map that the world lacks [m].
_GHOST_HEIGHT = 1.8

# Opacity of such walls at their foot; at their top it is 0.
_GHOST_STRENGTH = 0.55

# Where on a segment of the map it is looked up when that was found, in its length: away from
# corners, where other walls are near.
_PARTS = np.linspace(0.15, 0.85, 7)

# Length of the pieces of the map that are compared with walls [m].
_GHOST_STEP = 0.4

# Largest number of pieces of a segment: some are as long as the world.
_MOST_PIECES = 500

# Distance from all walls from which on a piece of a map is of a false wall [m].
FALSE_FROM = 0.5

# Opacity of the trail long after.
_OLD = 0.35

# Largest number of ellipses that stay along the path: more would be one band.
MOST_KEPT = 40

# Size of the largest ellipse from which on ellipses are named [m]: smaller ones are hardly seen.
_NAMED_SIZE = 0.2

# Number of corners of an ellipse as drawn.
CORNERS = 48

# What legends call the trail of where the robot was.
TRUTH = "truth"


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
    """Draw a few beams of a scan, which fade out at the reach [m], all its hits, and its lamp.

    The pose of the scan, walls (n, 4), those that turn beams (m, 4) and apex (2,) are in the film's
    frame. The apex is where the robot stands now, a little past that pose: beams follow the robot
    while points stay on their walls. Points are coloured by their range or intensity.
    """
    origin = np.array([scan.pose.x, scan.pose.y])
    hits = scan.hits
    # A beam without return goes as far as it can be measured; one too near ends at once.
    far = min(scan.range_max, SIGHT_DISTANCE)
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
    step = max(1, round(len(ends) / _DRAWN_BEAMS))
    chosen = np.isin(beams, np.arange((len(ends) - 1) % step // 2, len(ends), step))
    chosen &= (gone < reach) | (gone == 0.0)
    starts, stops = np.hsplit(legs[chosen], 2)
    gone = gone[chosen, None]
    length = lengths(legs[chosen])[:, None]
    drawn = np.minimum(length, reach - gone)
    stops = starts + drawn / np.maximum(length, look.TINY) * (stops - starts)
    opacities = _BEAM_STRENGTH * (1.0 - np.hstack([gone, gone + drawn]) / reach)
    lines = level_lines(
        height, starts, stops, np.full((len(gone), 3), look.EMBER), opacities, look.FINE
    )
    return lines, points, _lamp(legs[: len(ends)], scan.angles, _LAMP_SHARE * reach)


def _lamp(legs: Float, angles: Float, reach: float) -> Soft:
    """Light on the ground along the first legs (n, 4) of beams at angles (n,) [rad].

    It fades to nothing at a reach [m], and at the sides of the field of view.
    """
    step = max(1, len(legs) // _LAMP_BEAMS)
    starts, ends = np.hsplit(legs[::step], 2)
    angles = angles[::step]
    away = lengths(legs[::step])
    far = np.minimum(away, reach)
    ends = starts + (far / np.maximum(away, look.TINY))[:, None] * (ends - starts)
    edge = np.minimum(angles - angles.min(), angles.max() - angles) / _LAMP_SIDE
    bright = look.LAMP * (1.0 if np.ptp(angles) > _AROUND else np.clip(edge, 0.0, 1.0)) + 0.0 * far
    dim = bright * (1.0 - far / reach) ** 2
    # Each triangle stands at the robot's end of a beam, on the far ends of that and the one before.
    amber = np.tile([look.TRAIL_HEIGHT, *look.EMBER], (len(far) - 1, 1))
    corners = (starts[1:], bright[1:]), (ends[:-1], dim[:-1]), (ends[1:], dim[1:])
    rows = np.stack([np.column_stack([places, amber, light]) for places, light in corners], axis=1)
    return Soft(single(rows[..., :3]), single(rows[..., 3:]))


def _point_colours(scan: LaserScan, by: str) -> Float:
    """Colours (hits, 3) of the hits of a scan by their ranges or their intensities."""
    share = scan.ranges[scan.hits] / min(scan.range_max, FARTHEST)
    if by == "intensity" and scan.intensities is not None:
        with np.errstate(divide="ignore"):
            share = np.log(scan.intensities[scan.hits]) / np.log(_DARKEST_HIT)
    return look.gradient(share, RANGE_COLOURS)


def _sides(origins: Float, walls: Float, numbers: Int) -> Float:
    """Normals (n, 2) of walls by number, towards where beams come from (n, 2); 0 for −1."""
    if not len(walls):
        return np.zeros_like(origins)
    along = walls[numbers, 2:] - walls[numbers, :2]
    toward = np.sign(cross(along, origins - walls[numbers, :2]))
    return np.asarray(along @ LEFT * np.where(numbers >= 0, toward, 0.0)[:, None])


@dataclass(frozen=True, eq=False, slots=True)
class DrawnMap:
    """A map as it is drawn, each wall in the colour of when it was found."""

    # (m, 4) its segments in the film's frame [m].
    segments: Float
    # (m, 3) red, green, blue in 0…1.
    colours: Float

    @classmethod
    def from_snapshot(
        cls,
        run: Shown,
        number: int,
        structures: Structures,
        exposure: Exposure,
        colour: look.Colour | None = None,
    ) -> "DrawnMap":
        """Take a map snapshot of a run; −1 is the empty map before the first.

        All may have one colour, but for false walls, which are red.
        """
        if number < 0:
            return cls(look.NOTHING, look.NOTHING[:, :3])
        last = run.snapshot_after(sys.maxsize)
        frame = np.tile(structures.origin, 2)
        drawn, whole = (run.maps[k].segments - frame for k in (number, last))
        colours = np.tile(colour or look.PALE_WALL, (len(drawn), 1))
        if colour is None:
            order = np.sort(_first_mapped(whole, exposure))
            times = _first_mapped(drawn, exposure)
            # What was found at once has one colour, half-way between what is earlier and later.
            ranks = np.searchsorted(order, times) + np.searchsorted(order, times, "right")
            colours = look.gradient(0.5 * ranks / max(1, len(order)), look.FOUND)
        if run.knows_truth:
            # A wall may go on into its reflection, or to where a robot was.
            drawn, owner, false = false_pieces(drawn, structures.tree)
            colours = colours[owner]
            colours[false] = look.FALSE_COLOUR
        return cls(drawn, colours)

    def lines(self, height: float, width: float) -> Lines:
        """Its segments as lines at a height [m], of a width [pixels]."""
        starts, ends = np.hsplit(self.segments, 2)
        return level_lines(
            height, starts, ends, self.colours, np.ones((len(self.segments), 2)), width
        )

    def longer(self, past: float) -> "DrawnMap":
        """Its segments, longer by some metres at both ends."""
        way = past * directions(self.segments)
        return DrawnMap(self.segments + np.hstack([-way, way]), self.colours)

    def bands(self, structures: Structures) -> Lines:
        """Its segments along the walls; those of glass at the foot, as bars would float in it."""
        lines = self.lines(_BAND, look.BOLD)
        middles = shapely.points(0.5 * (self.segments[:, :2] + self.segments[:, 2:]))
        segment, wall = structures.tree.query_nearest(middles, all_matches=False)
        for ends in lines.starts, lines.ends:
            ends[segment[structures.glass[wall]], 2] = look.TRAIL_HEIGHT
        return lines._replace(thick=_BAND_THICK)

    def tints(self, places: Float, tolerance: float) -> tuple[Float, Bool]:
        """Its colours (n, 3) at places (n, 2), and whether (n,) it is within a tolerance [m]."""
        tints = np.zeros((len(places), 3))
        near = np.zeros(len(places), dtype=bool)
        if len(self.segments):
            tree = shapely.STRtree(shapely.linestrings(self.segments.reshape(-1, 2, 2)))
            found, segment = tree.query_nearest(
                shapely.points(places), max_distance=tolerance, all_matches=False
            )
            tints[found] = self.colours[segment]
            near[found] = True
        return tints, near

    def ghosts(self, structures: Structures, tolerance: float) -> Soft:
        """What of its segments lies on no wall within a tolerance [m], standing free."""
        pieces, owner, loose = false_pieces(self.segments, structures.tree, tolerance)
        a, b = (np.insert(place, 2, 0.0, axis=1) for place in np.hsplit(pieces[loose], 2))
        up = np.array([0.0, 0.0, _GHOST_HEIGHT])
        corners = np.stack([a, b, b + up, a, b + up, a + up], axis=1).reshape(-1, 3, 3)
        strength = _GHOST_STRENGTH * np.tile([1.0, 1.0, 0.0, 1.0, 0.0, 0.0], len(loose))
        tints = np.repeat(self.colours[owner[loose]], 6, axis=0)
        return Soft(single(corners), single(np.column_stack([tints, strength]).reshape(-1, 3, 4)))


def false_pieces(
    segments: Float, walls: shapely.STRtree, tolerance: float = FALSE_FROM
) -> tuple[Float, Int, Int]:
    """Segments (n, 4) in parts (p, 4), the segment of each, and those parts that lie off all walls.

    Only what is farther from a wall than a tolerance [m] is cut into pieces.
    """
    on_walls = {"predicate": "dwithin", "distance": tolerance}
    ends = (shapely.points(places) for places in np.hsplit(segments, 2))
    # What has both ends near one straight wall is near it all along.
    start, end = (
        number * len(walls) + wall
        for number, wall in (walls.query(places, **on_walls) for places in ends)
    )
    near = np.unique(np.intersect1d(start, end) // max(1, len(walls)))
    far = np.delete(np.arange(len(segments)), near)
    count = np.clip(np.ceil(lengths(segments[far]) / _GHOST_STEP), 1, _MOST_PIECES).astype(int)
    pieces, owner = divided(segments[far], count)
    middles = shapely.points(0.5 * (pieces[:, :2] + pieces[:, 2:]))
    others, _ = walls.query(middles, **on_walls)
    false = len(near) + np.setdiff1d(np.arange(len(owner)), others)
    return np.concatenate([segments[near], pieces]), np.append(near, far[owner]), false


def divided(segments: Float, count: Int) -> tuple[Float, Int]:
    """Segments (n, 4) in numbers (n,) of equal pieces (p, 4), and the segment of each (p,)."""
    owner = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    start, end = np.hsplit(segments[owner], 2)
    low, high = (
        start + ((number + step) / count[owner])[:, None] * (end - start) for step in (0, 1)
    )
    return np.hstack([low, high]), owner


def _first_mapped(segments: Float, exposure: Exposure) -> Float:
    """When the map first had a part of segments (n, 4) [lengths of the run]."""
    start, end = np.hsplit(segments, 2)
    places = start + _PARTS[:, None, None] * (end - start)
    times = exposure.sampled(places.reshape(-1, 2))["mapped"]
    return np.asarray(times.reshape(len(_PARTS), -1).min(axis=0))


def believed(estimate: EstimatedTrajectory) -> str:
    """What legends call the trail of an estimate, whose ellipses may be too small to be seen."""
    sizes = np.linalg.norm(estimate.ellipses, axis=(1, 2))
    return "estimate, ellipses of 95 %" if sizes.max(initial=0.0) > _NAMED_SIZE else "estimate"


def trail_lines(
    keys: DriveKeys, now: float, fade: float, colour: tuple[float, float, float] = look.TRAIL_COLOUR
) -> Lines:
    """The trail up to a time [s]; what is older is paler, after a time of fading [s]."""
    begun = min(len(keys.times) - 1, int(np.searchsorted(keys.times, now)))
    places = keys.poses[: begun + 1, :2].copy()
    times = keys.times[: begun + 1]
    places[begun:] = interpolated(np.array([now]), keys.times, keys.poses[:, :2])
    old = np.clip((now - times) / fade, 0.0, 1.0)
    left = 1.0 + (_OLD - 1.0) * old * (2.0 - old)
    legs = np.flatnonzero(keys.driven[:begun])
    opacities = np.column_stack([left[legs], left[legs + 1]])
    return level_lines(
        look.TRAIL_HEIGHT,
        places[legs],
        places[legs + 1],
        np.tile(colour, (len(legs), 1)),
        opacities,
        look.BOLD,
    )


@dataclass(frozen=True, eq=False, slots=True)
class DrawnEstimate:
    """The estimate of a run as it is drawn."""

    # Where the robot believed that it was at each of its scans.
    keys: DriveKeys
    # (m,) the scans with which an ellipse is known.
    known: Int
    # (m, 2, 2) the matrices that make the ellipses of the unit circle [m].
    shapes: Float
    # (n,) numbers of the ellipses that stay along the path, faded.
    kept: Int

    @classmethod
    def from_timeline(cls, timeline: Timeline) -> "DrawnEstimate | None":
        """Take the estimate of a timeline's run; None if it has none."""
        estimate = timeline.run.estimate
        if estimate is None:
            return None
        keys = DriveKeys(
            timeline.run.trajectory.times - timeline.start, estimate.poses - [*timeline.origin, 0.0]
        )
        return cls(keys, estimate.known_scans, estimate.ellipses, kept_ellipses(estimate))

    def rings(self, time: float) -> Lines:
        """The ellipses that stay by a time, faded, and the one that is known now."""
        times = self.keys.times[self.known]
        now = np.array([time])
        rings = self.outlines()[times[self.kept] <= time]
        alpha = np.full((len(rings) * CORNERS, 2), look.ESTIMATE_FADED)
        if len(times):
            place = interpolated(now, self.keys.times, self.keys.poses[:, :2])
            shape = interpolated(now, times, self.shapes.reshape(-1, 4)).reshape(1, 2, 2)
            rings = np.concatenate([rings, outlines(place, shape)])
            alpha = np.concatenate([alpha, np.ones((CORNERS, 2))])
        starts = rings.reshape(-1, 2)
        ends = np.roll(rings, -1, axis=1).reshape(-1, 2)
        colours = np.tile(look.ESTIMATE_COLOUR, (len(alpha), 1))
        return level_lines(look.TRAIL_HEIGHT, starts, ends, colours, alpha, 1.5 * look.FINE)

    def outlines(self) -> Float:
        """Outlines (n, CORNERS, 2) of the ellipses that stay [m]."""
        return outlines(self.keys.poses[self.known[self.kept], :2], self.shapes[self.kept])


def outlines(middles: Float, shapes: Float) -> Float:
    """Outlines (n, CORNERS, 2) of ellipses with middles (n, 2) and matrices (n, 2, 2) [m]."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(middles[:, None] + np.einsum("nij,cj->nci", shapes, circle))


def kept_ellipses(estimate: EstimatedTrajectory) -> Int:
    """Which ellipses (n,) stay along the path: at most this number, and none that overlap."""
    steps = np.hypot(*np.diff(estimate.poses[:, :2], axis=0).T)
    driven = np.append(0.0, np.cumsum(steps))
    sizes = np.linalg.norm(estimate.ellipses, axis=(1, 2)).tolist()
    kept = list[int]()
    last = -np.inf
    for number, (place, size) in enumerate(zip(driven[estimate.known_scans], sizes, strict=True)):
        # The start is certain: a point, and no ellipse.
        if size > 0.0 and place - last >= max(steps.sum() / MOST_KEPT, size):
            kept.append(number)
            last = place
    return np.array(kept, dtype=np.int64)


def estimate_words(run: Shown, scan: int) -> tuple[tuple[str, str], ...]:
    """What the panel says of a run's estimate after a scan: for each trail its name and its error.

    Nothing where the robot was given its poses.
    """
    estimate = run.estimate
    if estimate is None:
        return ()
    if not run.knows_truth:
        return ((believed(estimate), ""),)
    apart = float(np.hypot(*(estimate.poses[scan, :2] - run.trajectory.poses[scan, :2])))
    return ((TRUTH, ""), (believed(estimate), f"{apart:.2f} m off"))
