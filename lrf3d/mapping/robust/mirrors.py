"""Mirrors: where a room behind a wall is the mirror image of what stands before it.

A wall of a scan and a segment of the map define the line that mirrors one into the other. Lines on
which several scans agree are looked at through all kept scans. Such a line is a mirror as far as
all returns behind it are images of walls that turn, and all of these are darker than the walls by
the same share: no mirror reflects all light, and a room that is merely symmetrical is as bright.
"""

import numpy as np

from lrf3d.compiling import compiled, inner
from lrf3d.geometry import Bool, Float, Int
from lrf3d.mapping.robust.glass import DEVIATIONS, ON_LINE
from lrf3d.mapping.robust.ground import Ground
from lrf3d.mapping.robust.lit_scans import (
    DEVIATION,
    LIGHT,
    PIECE,
    PIECES,
    RANGE,
    UX,
    UY,
    LitScans,
    runs,
    stretches,
    way_to_first,
)

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

DEPTH = 0.2
"""[m] How far behind a mirror an image lies at least."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back, beside what noise explains."""

SAME_ANGLE, SAME_DISTANCE = np.radians(2.0), 0.1
"""[rad, m] Two lines nearer than this are one: the faces of a thin wall are two."""

LINES_A_SCAN, MOST_LINES = 6, 256
"""[lines] How many lines of a scan count, those first that most walls agree on, and in all."""

LEAST_VOTES, MORE_VOTES = 3, 1.5
"""[scans, factor] A line is looked at when so many scans agree on it, and again when so many
times more do."""

LOOKS, LOOK_AGAIN = 2, 16
"""[lines, scans] Lines that are looked at with each kept scan; a mirror is after so many again."""

QUICK = 4
RAYS_A_LOOK, MOST_IMAGES = 200, 4096
"""[rays, images] How many of each kept scan are looked at, of more every second one, or third; and
how many images are compared with what they are of."""

IMAGES_A_PIECE, IMAGE_FACTOR = 3, 3.0
"""[beams, factor] Images in each piece of a mirror, and how much more than other returns."""

LEAST_LIT = 8
"""[beams] … with so many images of walls of which the reflectance is known."""

DIMMED, LIGHT_DEVIATION, AGREE = (0.6, 0.97), 0.05, 0.7
"""[share] How bright images are beside what they are of, how far it may differ from one to another,
and for how many of them not more: others are of metal, or at an edge of two walls."""

LEAST_SLOPE = 0.3
"""[cosine] … of beams that met the wall no flatter."""

ONE_WAY = 0.95
"""[share] Length of the mean of the directions of the images, doubled, above which they all run one
way: many lines mirror one wall into another."""


@inner
def image_line(place: Float, wall: Float, real: Float, line: Float) -> float:
    """Write the line (3,) that mirrors a segment (4,) of the map into a wall (4,) of a scan.

    Returns:
        The length [m] that the mirrored wall and the segment share, 0 where there is no such line.
    """
    ax, ay = wall[2] - wall[0], wall[3] - wall[1]
    bx, by = real[2] - real[0], real[3] - real[1]
    length, size = np.hypot(ax, ay), np.hypot(bx, by)
    if not (length > 0.0 and size > 0.0):
        return 0.0
    ax, ay, bx, by = ax / length, ay / length, bx / size, by / size
    # The normals of the two walls, (−y, x): a mirror turns both directions and sides.
    nx, ny = ay - by, bx - ax
    turn = np.hypot(nx, ny)
    if turn < PARALLEL_SINE:
        return 0.0
    nx, ny = nx / turn, ny / turn
    own = ax * wall[1] - ay * wall[0]
    other = bx * real[1] - by * real[0]
    distance = (own - other) / (2.0 * (ax * ny - ay * nx))
    ahead = nx * place[0] + ny * place[1] - distance
    if ahead < 0.0:
        nx, ny, distance, ahead = -nx, -ny, -distance, -ahead
    if ahead < DEPTH:
        return 0.0
    low, high = np.inf, -np.inf
    for end in range(2):
        x, y = wall[2 * end], wall[2 * end + 1]
        behind = nx * x + ny * y - distance
        x, y = x - 2.0 * behind * nx - real[0], y - 2.0 * behind * ny - real[1]
        if behind > DEPTH or abs(bx * y - by * x) > IMAGE_DISTANCE:
            return 0.0
        low, high = min(low, bx * x + by * y), max(high, bx * x + by * y)
    shared = min(high, size) - max(low, 0.0)
    line[0], line[1], line[2] = nx, ny, distance
    return shared if shared > 0.5 * length else 0.0


@compiled
def find_lines(place: Float, walls: Float, segments: Float, lines: Float, weights: Float) -> int:
    """Find lines that mirror segments (m, 4) of a map into walls (w, 4) of a scan.

    Args:
        place: Where the laser is [m].
        walls: The walls [m].
        segments: The segments [m].
        lines: (k, 3) is filled: unit normals towards the laser, and distances from the origin [m].
        weights: (k,) is filled with the lengths [m] that are shared.

    Returns:
        The number of lines.
    """
    count, line = 0, np.empty(3)
    for wall in range(len(walls)):
        for row in range(len(segments)):
            shared = image_line(place, walls[wall], segments[row], line)
            if shared <= 0.0:
                continue
            own = same_line(place, lines[:count], line)
            if own < 0:
                if count == len(lines):
                    continue
                own, count = count, count + 1
                lines[own] = line
                weights[own] = 0.0
            weights[own] += shared
    return count


@compiled
def same_line(place: Float, lines: Float, line: Float) -> int:
    """Which of lines (k, 3) is another one (3,), as seen from a place (2,): the nearest, or −1."""
    ahead = line[0] * place[0] + line[1] * place[1] - line[2]
    x, y = place[0] - ahead * line[0], place[1] - ahead * line[1]
    least, found = SAME_DISTANCE, -1
    for row in range(len(lines)):
        cos = lines[row, 0] * line[0] + lines[row, 1] * line[1]
        apart = abs(lines[row, 0] * x + lines[row, 1] * y - lines[row, 2])
        if cos > np.cos(SAME_ANGLE) and apart < least:
            least, found = apart, row
    return found


@compiled
def count_images(
    places: Float, rays: Float, line: Float, middle: float, segments: Float, blocking: Float,
    pieces: Float, reach: Float, images: Float, stride: int,
) -> int:  # fmt: skip
    """Count what beams show at each piece of a line (3,).

    Args:
        places: (k, 2) where scans were taken [m].
        rays: (k, n, 7) their rays.
        line: Its unit normal, towards the laser, and its distance from the origin [m].
        middle: Where its pieces have their middle, along the normal turned right [m].
        segments: (m, 4) the segments of the map in front of it [m].
        blocking: (b, 4) other mirrors, and glass, behind which beams show nothing [m].
        pieces: (PIECES, 6) is added to: images, other returns behind, returns on the line, returns
            behind what blocks, and the sums of the cosines and sines of twice the directions of the
            images.
        reach: (PIECES, 2) is widened to the stations [m] of the images.
        images: (i, 4) is filled with images: piece, place mirrored back, and how reflective the
            wall there is by the image.
        stride: Each so-many-th beam is looked at.

    Returns:
        The number of these.
    """
    nx, ny, distance = line[0], line[1], line[2]
    half, found = 0.5 * PIECE * PIECES, 0
    for scan in range(len(places)):
        x, y = places[scan, 0], places[scan, 1]
        ahead = nx * x + ny * y - distance
        if abs(ahead) < DEPTH:
            continue
        for beam in range(0, rays.shape[1], stride):
            ray = rays[scan, beam]
            rise = -(nx * ray[UX] + ny * ray[UY])
            if rise * ahead <= 0.0 or ray[RANGE] <= 0.0:
                continue
            way = ahead / rise
            tolerance = ON_LINE + DEVIATIONS * ray[DEVIATION]
            farther = (ray[RANGE] - way) * abs(rise)
            station = ny * (x + way * ray[UX]) - nx * (y + way * ray[UY]) - middle
            if farther < -tolerance or abs(station) >= half:
                continue
            piece = int(np.floor((station + half) / PIECE))
            # From behind nothing passes a mirror.
            if abs(farther) < max(tolerance, DEPTH) or ahead < 0.0:
                pieces[piece, 2] += 1.0
                continue
            if len(blocking) and way_to_first(places[scan], ray, blocking) < ray[RANGE]:
                pieces[piece, 3] += 1.0
                continue
            px = x + ray[RANGE] * ray[UX] + 2.0 * farther * nx
            py = y + ray[RANGE] * ray[UY] + 2.0 * farther * ny
            allowed, row = IMAGE_DISTANCE + DEVIATIONS * ray[DEVIATION], -1
            for other in range(len(segments)):
                dx = segments[other, 2] - segments[other, 0]
                dy = segments[other, 3] - segments[other, 1]
                size = np.hypot(dx, dy)
                ox, oy = px - segments[other, 0], py - segments[other, 1]
                aside = abs(ox * dy - oy * dx)
                along = ox * dx + oy * dy
                if aside < allowed * size and -allowed * size < along < (size + allowed) * size:
                    allowed, row = aside / size, other
            if row < 0:
                pieces[piece, 1] += 1.0
                continue
            pieces[piece, 0] += 1.0
            reach[piece, 0] = min(reach[piece, 0], station)
            reach[piece, 1] = max(reach[piece, 1], station)
            dx = segments[row, 2] - segments[row, 0]
            dy = segments[row, 3] - segments[row, 1]
            size = np.hypot(dx, dy)
            dx, dy = dx / size, dy / size
            pieces[piece, 4] += dx * dx - dy * dy
            pieces[piece, 5] += 2.0 * dx * dy
            # The beam as it goes on from the mirror.
            ox, oy = ray[UX] + 2.0 * rise * nx, ray[UY] + 2.0 * rise * ny
            cos = abs(ox * dy - oy * dx)
            if found < len(images) and cos > LEAST_SLOPE and ray[LIGHT] > 0.0:
                images[found, 0], images[found, 1], images[found, 2] = piece, px, py
                images[found, 3] = ray[LIGHT] / cos
                found += 1
    return found


class Mirrors:
    """Lines that may be mirrors, and where they are.

    Attributes:
        segments: (s, 4) the mirrors, seen from their left [m].
    """

    def __init__(self) -> None:
        self._lines, self._votes = np.empty((0, 3)), np.empty(0)
        # The votes of each line when it was looked at, the number of the scan, and its mirrors.
        self._looked: Int = np.empty(0, np.int64)
        self._voted: Int = np.empty(0, np.int64)
        self._found: list[Float] = []
        self.segments = np.empty((0, 4))

    def add(self, number: int, place: Float, walls: Float, segments: Float) -> None:
        """Add the lines that mirror segments (m, 4) of the map into walls (w, 4) of a scan [m]."""
        lines, weights = np.empty((64, 3)), np.empty(64)
        count = find_lines(place, walls, segments, lines, weights)
        for row in np.argsort(-weights[:count], kind="stable")[:LINES_A_SCAN].tolist():
            line, own = lines[row], same_line(place, self._lines, lines[row])
            if own < 0:
                if len(self._lines) == MOST_LINES:
                    self._forget()
                self._lines = np.vstack([self._lines, line])
                self._votes = np.append(self._votes, 1.0)
                self._looked = np.append(self._looked, 0)
                self._voted = np.append(self._voted, number)
                self._found.append(np.empty((0, 4)))
                continue
            count = min(self._votes[own], 50.0)
            mixed = (count * self._lines[own] + line) / (count + 1.0)
            mixed[:2] /= np.hypot(mixed[0], mixed[1])
            self._lines[own] = mixed
            self._votes[own] += 1.0
            self._voted[own] = number

    def _forget(self) -> None:
        """Forget the half of the lines on which fewest scans agree."""
        votes = np.where([len(found) > 0 for found in self._found], np.inf, self._votes)
        rows = np.sort(np.argsort(-votes, kind="stable")[: MOST_LINES // 2])
        self._lines, self._votes = self._lines[rows], self._votes[rows]
        self._voted, self._looked = self._voted[rows], self._looked[rows]
        self._found = [self._found[row] for row in rows.tolist()]

    def look(self, scans: LitScans, segments: Float, glass: Float, ground: Ground) -> bool:
        """Look at the line on which most scans agree of those that are due, and at a mirror.

        Args:
            scans: The kept scans.
            segments: (m, 4) the segments of the map [m].
            glass: (g, 4) the panes [m].
            ground: How bright walls are.

        Returns:
            Whether the mirrors have changed.
        """
        changed = False
        for _ in range(LOOKS):
            age = scans.count - self._looked
            there = np.array([len(found) > 0 for found in self._found], np.bool_)
            due = (self._voted > self._looked) & (self._votes >= LEAST_VOTES)
            due |= there & (age > LOOK_AGAIN)
            if not due.any():
                break
            row = int(np.argmax(due * self._votes * age))
            self._looked[row] = scans.count
            changed |= self._look(row, scans, segments, glass, ground)
        return changed

    def _look(
        self, row: int, scans: LitScans, segments: Float, glass: Float, ground: Ground
    ) -> bool:
        former = self._found[row]
        others = [found for other, found in enumerate(self._found) if other != row]
        self._found[row] = windows(
            scans, self._lines[row], segments, [glass, *others], ground, former
        )
        self.segments = np.concatenate([np.empty((0, 4)), *self._found])
        return not np.array_equal(former, self._found[row])


def windows(
    scans: LitScans,
    line: Float,
    segments: Float,
    blocking: list[Float],
    ground: Ground,
    former: Float,
) -> Float:
    """The stretches (s, 4) [m] of a line (3,) that are a mirror; see `Mirrors.look`."""
    # Seen from the left of its direction.
    normal, unit = line[:2], np.array([line[1], -line[0]])
    ahead = (segments.reshape(-1, 2) @ normal > line[2]).reshape(-1, 2).any(axis=1)
    middle = scans.places[scans.newest]
    middle = middle - (middle @ normal - line[2]) * normal
    pieces, reach = np.zeros((PIECES, 6)), np.full((PIECES, 2), (np.inf, -np.inf))
    images, count = np.empty((MOST_IMAGES, 4)), 0
    for stride in (QUICK, 1) if not len(former) else (1,):
        stride *= 1 + (scans.rays.shape[1] - 1) // RAYS_A_LOOK
        pieces[:], reach[:] = 0.0, (np.inf, -np.inf)
        count = count_images(
            scans.places, scans.rays, line, float(middle @ unit), segments[ahead],
            np.concatenate(blocking), pieces, reach, images, stride,
        )  # fmt: skip
        hint = pieces[:, 0] > np.maximum(pieces[:, 1], pieces[:, 2])
        if pieces[hint, 0].sum() * stride < LEAST_LIT:
            return former
    images = images[:count]
    share = images[:, 3] / ground.reflectance(images[:, 1:3])
    return stretches(
        mirror_pieces(pieces, images[:, 0], share),
        reach,
        pieces[:, :4].sum(axis=1),
        former,
        middle,
        unit,
    )


def mirror_pieces(pieces: Float, places: Float, share: Float) -> Bool:
    """Which pieces (PIECES,) of a line are a mirror.

    Args:
        pieces: (PIECES, 6) what beams did there, see `count_images`.
        places: (i,) the piece of each image.
        share: (i,) how bright it is compared with what it is of; NaN where that is not known.
    """
    images, wrong, stopped, _, cosines, sines = pieces.T
    good = (images >= IMAGES_A_PIECE) & (images > IMAGE_FACTOR * np.maximum(wrong, stopped))
    found = np.zeros(PIECES, np.bool_)
    for first, last in runs(good):
        turn = np.hypot(cosines[first:last].sum(), sines[first:last].sum())
        own = share[(places >= first) & (places < last) & np.isfinite(share)]
        if len(own) < LEAST_LIT or turn > ONE_WAY * images[first:last].sum():
            continue
        usual = float(np.median(own))
        agree = float((np.abs(own - usual) < LIGHT_DEVIATION).mean())
        found[first:last] = DIMMED[0] < usual < DIMMED[1] and agree > AGREE
    return found
