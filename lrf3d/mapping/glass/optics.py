"""Optics: the glass and mirrors of a map, from the light of scans with intensities.

Scans with intensities enter; scans without images of mirrors leave, and glass and mirrors, which
take the place of the fragments of them in the map. Scans without intensities, or whose intensities
are no light, change nothing.

Two observations vote for a line: a flash, which gives a line across its beam, and a wall of a scan
that a line mirrors into a segment of the map. Most of these lines are nothing, since walls of rooms
mirror each other: `surfaces` decides by what the beams of kept scans did there.

Along a diffuse wall the light of a beam falls with the cosine of the incidence and the square of
the range. The numbers that many devices report do not, and show neither glass nor mirrors.
"""

import warnings
from dataclasses import replace

import numpy as np

from lrf3d.base.errors import Lrf3dWarning
from lrf3d.compiling import record
from lrf3d.geometry.lines import Bool, Float, Records, cross, directions, lengths
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.glass.surfaces import (
    COUNTS,
    FLASH,
    IS_MIRROR,
    PATCH,
    PATCHES,
    PIECE_LENGTH,
    PIECES,
    count_rays,
    find_pieces,
    find_turned,
    turn_rays,
)
from lrf3d.mapping.line_map import GLASS, MIRROR, LineMap
from lrf3d.mapping.robust.beams import CELL, Beams
from lrf3d.mapping.robust.cells import FREE_DEPTH, Cells
from lrf3d.mapping.robust.extraction import LEAST_INCIDENCE
from lrf3d.mapping.robust.walls import Walls

# [votes] New votes after which a line is examined.
LEAST_VOTES = 2.0

# [votes] Votes of a flash, as only glass, mirrors and metal flash; an image gives one.
FLASH_VOTES = 8.0

# [votes] Number of observations that a line is averaged over.
MOST_VOTES = 50.0

# [cosine] Largest angle between two observations of one line.
SAME_COSINE = np.cos(np.radians(2.0))

# The votes for a line.
VOTES = record(
    total=float, new=float,  # in all, and since the line was examined
    last=float,  # the number of the last one
    kind=int,  # what the line was found to be
)  # fmt: skip

# A beam of a kept scan.
RAY = record(
    ux=float, uy=float,  # the unit vector of the beam
    range=float,  # [m] 0 where nothing returned
    free=float,  # [m] how far it is free at least
    deviation=float,  # [m] the standard deviation of the range
    bright=float,  # the light of the return as if from 1 m, compared with the usual one
    reflectance=float,  # how reflective the wall is that it is on, 0 where it is on none
    first=float,  # [m] how far it goes to the first known glass or mirror
    direct=float,  # 1 if it ended where it went to, and no mirror turned it
)  # fmt: skip

# [scans] Scans kept: at least the last 80 m of a drive. Mirrors found before remain.
MOST_SCANS = 160


class LitScans:
    """The last kept scans: their places (k, 2) [m], and :data:`RAY` (k, n) by rising angle."""

    def __init__(self) -> None:
        self._places = np.zeros((MOST_SCANS, 2))
        self._rays = np.zeros((MOST_SCANS, 0), RAY)
        self._last = np.full(3, np.inf)
        self._usual = 0.0
        self._fitting = self._pairs = self._count = 0
        self._warned = False

    def rows(self, newest: bool) -> tuple[Float, Records]:
        """Places and rays of all kept scans, or of the newest alone."""
        last = (self._count - 1) % MOST_SCANS
        rows = slice(last, last + 1) if newest else slice(0, self._count)
        return self._places[rows], self._rays[rows]

    def keep(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float
    ) -> bool:
        """Keep a scan with its walls (w, 4) around the laser in place of the oldest.

        Returns whether it was kept and the intensities so far are light. A scan is dropped if it
        has no intensities, or if the robot has hardly moved.
        """
        off = np.abs(np.array(pose) - self._last)
        least_motion = 0.5  # [m, rad] Motion of the robot after which a scan is kept.
        if scan.intensities is None or (max(np.hypot(*off[:2]), off[2]) <= least_motion):
            return False
        lights = scan.intensities[np.argsort(scan.angles, kind="stable")]
        units, free, _ = Beams.of(scan, pose[2], noise)
        ranges = free.clip(0.0)
        light = np.where((lights > 0.0) & (lights < np.inf), lights * ranges * ranges, 0.0)
        if not light.any():
            return False
        # [share] Quantile of the light of the returns of a scan that is its usual light: near a
        # front of glass most are dim.
        usual_share = 0.7
        usual = float(np.log(np.quantile(light[light > 0.0], usual_share)))
        self._usual = (self._count * self._usual + usual) / (self._count + 1)
        more = max(len(light) - self._rays.shape[1], 0)
        self._rays = np.pad(self._rays, ((0, 0), (0, more))) if more else self._rays
        row = self._count % MOST_SCANS
        self._places[row] = pose[:2]
        self._rays[row] = 0
        self._last = np.array(pose)
        rays = self._rays[row, : len(light)]
        rays["ux"], rays["uy"] = units.T
        rays["range"] = ranges
        rays["free"] = np.abs(free)
        rays["deviation"] = np.sqrt(noise.variance(ranges))
        rays["bright"] = light / np.exp(self._usual)
        self._read_reflectances(rays, light, walls)
        self._count += 1
        # [share] Least share of pairs that fits if intensities are light: metal and glass never do.
        least_fitting = 0.5
        # [pairs] Fewest pairs by which that is decided.
        least_pairs = 100
        are_light = self._fitting >= least_fitting * self._pairs
        if self._pairs >= least_pairs and not are_light and not self._warned:
            self._warned = True
            warnings.warn(
                "intensities do not fall with range and incidence as light does: the map has no"
                " glass and no mirrors", Lrf3dWarning, stacklevel=2,
            )  # fmt: skip
        return self._pairs >= least_pairs and are_light

    def _read_reflectances(self, rays: Records, light: Float, walls: Float) -> None:
        """Fill in the reflectances of the walls (w, 4) that rays (n,) end on, and count pairs."""
        if not len(walls):
            return
        lit = np.flatnonzero(light)
        along = directions(walls)
        units = np.column_stack([rays["ux"], rays["uy"]])[lit, None]
        off = units * rays["range"][lit, None, None] - walls[:, :2]
        station = (off * along).sum(axis=2)
        cosines = np.abs(cross(along, units))
        on = (np.abs(cross(along, off)) < CELL) & (cosines > LEAST_INCIDENCE)
        on &= (station > -CELL) & (station < lengths(walls) + CELL)
        there = on.any(axis=1)
        wall = on.argmax(axis=1)
        lit = lit[there]
        cosine = cosines[there, wall[there]]
        wall = wall[there]
        rays["reflectance"][lit] = reflectance = light[lit] / cosine
        # [share] Least distance in the scan of two returns of a wall that are compared.
        farther_apart = 0.05
        # [log] Least difference of these by the laser equation.
        least_change = 0.2
        # Adjacent returns differ too little to be compared.
        apart = int(farther_apart * len(rays)) + 1
        expected = np.log(cosine / rays["range"][lit] ** 2)
        found = np.log(reflectance)
        change = np.abs(expected[apart:] - expected[:-apart])
        compared = (wall[apart:] == wall[:-apart]) & (change > least_change)
        # [share] Largest relative error of that difference. Light that falls with the range alone
        # has a third.
        largest_misfit = 0.3
        fits = np.abs(found[apart:] - found[:-apart]) < largest_misfit * change
        self._pairs += int(compared.sum())
        self._fitting += int((fits & compared).sum())


class Optics:
    """The glass and mirrors that the scans so far have shown."""

    def __init__(self) -> None:
        self._scans = LitScans()
        self._ground = np.zeros(0, PATCH)
        most_lines = 256  # [lines] Number of lines that are kept.
        # Each line has a unit normal, distance and middle (see `count_rays`), votes, and the class
        # of its pieces: glass or mirror.
        self._lines = np.zeros((most_lines, 4))
        self._votes = np.zeros(most_lines, VOTES)
        self._pieces = np.zeros((most_lines, PIECES), np.bool_)
        self.surfaces = np.zeros((0, 5))
        """Glass and mirrors (s, 5) [m] in the map's frame, and whether each is a mirror."""

    def without_images(
        self, scan: LaserScan, place: tuple[float, float], heading: float
    ) -> LaserScan:
        """A scan from a place [m] with a heading [rad] in the map's frame, without images."""
        if scan.intensities is None or not len(self.surfaces):
            return scan
        turned = np.zeros(len(scan.angles), np.bool_)
        ranges = np.array(scan.ranges)
        find_turned(np.array(place), scan.angles + heading, ranges, self.surfaces, turned)
        if not turned.any():
            return scan
        return replace(
            scan, ranges=np.where(turned, -np.inf, ranges), walls=np.full(len(turned), -1),
            intensities=None, echoes=None, echo_intensities=None,
        )  # fmt: skip

    def update(
        self, scan: LaserScan, pose: tuple[float, float, float], noise: RangeNoise, walls: Float,
        segments: Float, cells: Cells, table: Walls,
    ) -> None:  # fmt: skip
        """Learn from a scan, its walls (w, 4) around the laser, and segments (m, 4) of the map.

        Returns that a mirror is now known to have turned are deleted, as new evidence of their
        walls.
        """
        if not self._scans.keep(scan, pose, noise, walls):
            return
        missing = len(cells.passes) * PATCHES - len(self._ground)
        if missing > 0:
            self._ground = np.pad(self._ground, (0, missing))
        places, rays = self._scans.rows(newest=True)
        turn_rays(places, rays, self.surfaces, cells, self._ground, table)
        place = places[0]
        bright = rays["bright"][0]
        peaks = (bright > FLASH) & (bright > np.roll(bright, 1)) & (bright >= np.roll(bright, -1))
        normals = -np.column_stack([rays["ux"][0, peaks], rays["uy"][0, peaks]])
        flashes = np.column_stack([normals, normals @ place - rays["range"][0, peaks]])
        self._vote(place, image_lines(place, walls + np.tile(place, 2), segments), 1.0)
        self._vote(place, flashes, FLASH_VOTES)
        known = self._pieces.copy()
        places, rays = self._scans.rows(newest=False)
        # The line that waits with most votes, and one that has just flashed.
        for row in np.argsort(-self._votes["new"], kind="stable")[: 1 + peaks.any()].tolist():
            votes = self._votes[row]
            if votes.new >= LEAST_VOTES:
                counts = np.zeros(PIECES, COUNTS)
                votes.new = 0.0
                count_rays(self._lines[row], places, rays, cells, self._ground, counts)
                self._pieces[row], votes.kind = find_pieces(counts, known[row], votes.kind)
        if not np.array_equal(known, self._pieces):
            self.surfaces = self._stretches()
            turn_rays(places, rays, self.surfaces, cells, self._ground, table)

    def _vote(self, place: Float, lines: Float, votes: float) -> None:
        """Add the votes of a scan from a place (2,) for lines (n, 3), each to the same known line.

        A new line takes a free row, or that of the line without a vote for the longest time.
        """
        distances = line_distances(place, self._lines, lines)
        for line, apart in zip(lines, distances, strict=True):
            row = int(apart.argmin())
            own = self._lines[row]
            if apart[row] >= CELL:
                row = int(np.where(self._votes["kind"], np.inf, self._votes["last"]).argmin())
                self._votes[row] = 0
                self._lines[row] = *line, line[1] * place[0] - line[0] * place[1]
            elif self._votes[row].kind != IS_MIRROR:
                own[:3] *= min(self._votes[row].total, MOST_VOTES)
                own[:3] += np.sign(own[:2] @ line[:2]) * line
                own[:3] /= np.hypot(own[0], own[1])
            known = self._votes[row]
            known.total += 1.0
            known.new += votes
            known.last = self._votes["last"].max() + 1.0

    def _stretches(self) -> Float:
        """The stretches (s, 5) [m] of all lines by their pieces, and whether each is a mirror."""
        rows, places = np.nonzero(np.diff(self._pieces, axis=1, prepend=False, append=False))
        rows = rows[::2]
        ends = places.reshape(-1, 2)
        mirror = self._votes["kind"][rows] == IS_MIRROR
        # A pane ends anywhere in the last piece that showed it; at that of a mirror most beams did.
        ends = ends + np.where(mirror, 0.0, 0.5)[:, None] * [1.0, -1.0] - PIECES // 2
        nx, ny, distance, middle = self._lines[rows].T[..., None]
        along = middle + PIECE_LENGTH * ends
        x = distance * nx + along * ny
        y = distance * ny - along * nx
        found = np.column_stack([x[:, 0], y[:, 0], x[:, 1], y[:, 1], mirror])
        shortest = 0.6  # [m] Least length of a pane or a mirror.
        solid: Bool = along[:, 1] - along[:, 0] > shortest
        return np.asarray(found[solid])


def image_lines(place: Float, walls: Float, segments: Float) -> Float:
    """The lines (k, 3) that mirror segments (m, 4) of a map into most walls (w, 4) of a scan.

    They are unit normals towards the laser's place (2,) and distances from the origin [m].
    """
    along = directions(walls)
    units = directions(segments)
    # The normals of the two walls, (−y, x): a mirror turns both directions and sides.
    turn = along[:, None] - units
    # [sine] Twice the sine of half the least angle between a wall and its image: walls at right
    # angles to a mirror continue in their images, and do not locate it.
    parallel_sine = 0.2
    wall, real = np.nonzero((turn * turn).sum(axis=2) >= parallel_sine**2)
    normals = turn[wall, real, ::-1] * [1.0, -1.0]
    normals /= np.hypot(*normals.T)[:, None]
    apart = cross(along, walls[:, :2])[wall] - cross(units, segments[:, :2])[real]
    distances = apart / (2.0 * cross(along[wall], normals))
    ahead = normals @ place - distances
    normals = np.sign(ahead)[:, None] * normals
    distances = np.sign(ahead) * distances
    ends = walls[wall].reshape(-1, 2, 2)
    behind = (ends * normals[:, None]).sum(axis=2) - distances[:, None]
    rows = np.flatnonzero((np.abs(ahead) >= FREE_DEPTH) & (behind <= FREE_DEPTH).all(axis=1))
    wall = wall[rows]
    real = real[rows]
    normals = normals[rows]
    distances = distances[rows]
    images = ends[rows] - 2.0 * behind[rows, :, None] * normals[:, None]
    off = images - segments[real, None, :2]
    unit = units[real, None]
    stations = (off * unit).sum(axis=2)
    high = np.minimum(stations.max(axis=1), lengths(segments)[real])
    shared = high - stations.min(axis=1).clip(0.0)
    good = (np.abs(cross(unit, off)) <= CELL).all(axis=1)
    good &= shared > 0.5 * lengths(walls)[wall]
    rows = np.flatnonzero(good)[np.argsort(-shared[good], kind="stable")]
    # [lines] Largest number of lines of a scan that count: those that most of its walls support.
    lines_a_scan = 8
    # [images] Largest number of images compared for this: those that share most with a wall.
    most_a_scan = 64
    lines = np.column_stack([normals, distances])[rows[:most_a_scan]]
    same = line_distances(place, lines, lines) < CELL
    weights = same @ shared[rows[:most_a_scan]]
    found: list[Float] = []
    while weights.any() and len(found) < lines_a_scan:
        best = int(weights.argmax())
        found.append(lines[best])
        weights[same[best]] = 0.0
    return np.reshape(found, (-1, 3))


def line_distances(place: Float, lines: Float, others: Float) -> Float:
    """Distances [m] (k, n) of lines (n, 3) from others (k, 3), at their points nearest to a place.

    Infinite where two are not parallel; the place is (2,).
    """
    feet = place - (others[:, :2] @ place - others[:, 2])[:, None] * others[:, :2]
    apart = np.abs(feet @ lines[:, :2].T - lines[:, 2])
    return np.where(np.abs(others[:, :2] @ lines[:, :2].T) > SAME_COSINE, apart, np.inf)


def with_surfaces(line_map: LineMap, surfaces: Float, mirrors: Bool) -> LineMap:
    """A map with surfaces (s, 4) [m], mirrors (s,) or glass, in place of segments along them."""
    if not len(surfaces):
        return line_map
    segments = line_map.segments
    objects = line_map.objects
    along = directions(surfaces)
    size = lengths(surfaces)
    # Where both ends (m, 2) of each segment lie along each surface (s,), and beside it.
    off = segments.reshape(-1, 2, 1, 2) - surfaces[:, :2]
    stations = (off * along).sum(axis=3)
    low = stations.min(axis=1)
    high = stations.max(axis=1)
    part = np.minimum(high, size) - np.maximum(low, 0.0) > 0.5 * lengths(segments)[:, None]
    part &= np.abs(cross(along, off)).max(axis=1) < CELL
    # Surfaces become as long as what they take in.
    first = np.where(part, low, 0.0).min(axis=0, initial=0.0)
    last = np.maximum(np.where(part, high, 0.0).max(axis=0, initial=0.0), size)
    ends = np.tile(surfaces[:, :2], 2) + np.column_stack([first, first, last, last]) * np.tile(
        along, 2
    )
    kept = ~part.any(axis=1)
    segments = segments[kept]
    objects = objects[kept]
    owners = objects.max(initial=-1) + 1 + np.arange(len(ends))
    joins = 0.4  # [m] A pane or mirror belongs to the object of a wall whose end is this close.
    if len(segments):
        tips = (segments.reshape(-1, 1, 2) - ends.reshape(-1, 2)).reshape(len(segments), 2, -1, 4)
        apart = np.hypot(tips[..., ::2], tips[..., 1::2]).min(axis=(1, 3))
        owners = np.where(apart.min(axis=0) < joins, objects[apart.argmin(axis=0)], owners)
    return LineMap(
        np.concatenate([segments, ends]),
        np.unique(np.concatenate([objects, owners]), return_inverse=True)[1],
        np.concatenate([line_map.points[kept], np.full(len(ends), 2)]),
        np.concatenate([line_map.kinds[kept], np.where(mirrors, MIRROR, GLASS)]),
    )
