"""Lit scans: the beams of scans with their light, of which the last ones are kept.

Scans enter as the mapper takes them. What is thought to be glass or a mirror is looked at again
through all kept scans, so that nothing needs to be counted twice or taken back.
"""

from typing import NamedTuple

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Bool, Float, Int

UX, UY, RANGE, FREE, DEVIATION, LIGHT, BRIGHT = range(7)
"""Columns of `LitScan.rays`: the unit vector of each beam; its range [m], 0 where nothing returned;
how far it is free at least [m]; the standard deviation of the range [m]; the light of the return
as if from 1 m, and how bright it was compared with the usual one."""

PIECE, PIECES = 0.25, 256
"""[m, pieces] Length of a piece of a line, in which beams are counted, and their number: 64 m."""

SEEN = 3
"""[beams] A piece that fewer of the kept scans' beams meet is what it was thought to be before."""

SHORTEST = 0.5
"""[m] Length of a pane or a mirror from which on it is found."""

MOST_SCANS = 80
"""[scans] So many are kept: of a drive at least the last 38 m."""

LEAST_WAY, LEAST_TURN = 0.5, 0.5
"""[m, rad] A scan is kept if the robot has moved or turned by so much since the last one."""

USUAL_SHARE = 0.7
"""[share] The usual brightness of a return is that which so many have at most: beside a front of
glass most are dim."""

BRIGHTNESSES, STEPS_AN_OCTAVE = 512, 4
"""[steps] Steps in which brightness is counted, in all and for each factor of two."""


class LitScan(NamedTuple):
    """A scan in the map's frame: its place (2,), heading, and rays (n, 7) by rising angle."""

    place: Float
    heading: float
    rays: Float

    @property
    def ends(self) -> Float:
        """Where the beams (n, 2) ended [m]."""
        ends: Float = self.place + self.rays[:, RANGE, None] * self.rays[:, [UX, UY]]
        return ends

    def crossings(self, segments: Float) -> tuple[Float, Float]:
        """How far [m] beams (m, n) went to segments (m, 4), or infinity, and their cosines."""
        x, y = (segments[:, :2] - self.place).T[:, :, None]
        along = segments[:, 2:] - segments[:, :2]
        size = np.hypot(along[:, 0], along[:, 1])
        dx, dy = (along / size[:, None]).T[:, :, None]
        across = dx * self.rays[:, UY] - dy * self.rays[:, UX]
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (dx * y - dy * x) / across
            station = way * (dx * self.rays[:, UX] + dy * self.rays[:, UY]) - (dx * x + dy * y)
        on = (way > 0.0) & (station > 0.0) & (station < size[:, None])
        return np.where(on, way, np.inf), np.abs(across)


class LitScans:
    """The last kept scans.

    Attributes:
        places: (k, 2) where they were taken [m].
        rays: (k, n, 7) their rays; rows of zeros where a scan has fewer.
        kinds: (k, n) what each beam shows where it ended, see `ground`; it is kept for `Optics`.
        count: The number of all scans that were kept so far.
    """

    def __init__(self) -> None:
        self._places, self._rays = np.zeros((MOST_SCANS, 2)), np.zeros((MOST_SCANS, 0, 7))
        self._kinds = np.zeros((MOST_SCANS, 0), np.int64)
        self._brightness = np.zeros(BRIGHTNESSES, np.int64)
        self._last = np.full(3, np.inf)
        self.count = 0

    @property
    def places(self) -> Float:
        """(k, 2) where they were taken [m]."""
        return self._places[: self.count]

    @property
    def rays(self) -> Float:
        """(k, n, 7) their rays."""
        return self._rays[: self.count]

    @property
    def kinds(self) -> Int:
        """(k, n) what each beam shows where it ended."""
        return self._kinds[: self.count]

    @property
    def newest(self) -> int:
        """The row of the scan that was kept last."""
        return (self.count - 1) % MOST_SCANS

    def usual_brightness(self, brightness: Float) -> float:
        """The usual brightness of a return, which those (n,) of another scan add to."""
        steps = np.floor(STEPS_AN_OCTAVE * np.log2(brightness)) + BRIGHTNESSES // 2
        np.add.at(self._brightness, steps.clip(0, BRIGHTNESSES - 1).astype(np.int64), 1)
        below = np.cumsum(self._brightness)
        step = int(np.searchsorted(below, USUAL_SHARE * below[-1]))
        return float(2.0 ** ((step + 0.5 - BRIGHTNESSES // 2) / STEPS_AN_OCTAVE))

    def keep(self, scan: LitScan) -> bool:
        """Keep a scan in place of the oldest, unless the robot stands nearly where it did."""
        moved = np.hypot(*(scan.place - self._last[:2])) > LEAST_WAY
        if not (moved or abs(scan.heading - self._last[2]) > LEAST_TURN):
            return False
        more = len(scan.rays) - self._rays.shape[1]
        if more > 0:
            self._rays = np.pad(self._rays, ((0, 0), (0, more), (0, 0)))
            self._kinds = np.pad(self._kinds, ((0, 0), (0, more)))
        row = self.count % MOST_SCANS
        self._places[row], self._rays[row], self._kinds[row] = scan.place, 0.0, 0
        self._rays[row, : len(scan.rays)] = scan.rays
        self._last = np.array([*scan.place, scan.heading])
        self.count += 1
        return True


@inner
def way_to_first(place: Float, ray: Float, segments: Float) -> float:
    """How far [m] a ray goes to the first of segments (m, 4) that it crosses, or infinity."""
    first = np.inf
    for row in range(len(segments)):
        x, y = segments[row, 0] - place[0], segments[row, 1] - place[1]
        dx, dy = segments[row, 2] - segments[row, 0], segments[row, 3] - segments[row, 1]
        across = ray[UX] * dy - ray[UY] * dx
        if across == 0.0:
            continue
        way = (x * dy - y * dx) / across
        share = (x * ray[UY] - y * ray[UX]) / across
        if 0.0 < way < first and 0.0 <= share <= 1.0:
            first = way
    return first


def stretches(
    found: Bool, reach: Float, beams: Float, former: Float, middle: Float, unit: Float
) -> Float:
    """Stretches (s, 4) [m] of a line: those that are found, and parts that are no longer seen.

    Args:
        found: (PIECES,) which pieces are of one.
        reach: (PIECES, 2) the first and the last station [m] of what shows it, in each.
        beams: (PIECES,) the number of beams that meet each piece.
        former: (f, 4) the stretches that were found before [m].
        middle: (2,) the middle of the pieces [m].
        unit: (2,) direction of the line.
    """
    edges = PIECE * (np.arange(PIECES + 1) - PIECES // 2)
    found, reach = found.copy(), reach.copy()
    for ends in (former.reshape(-1, 2, 2) - middle) @ unit:
        low, high = float(ends.min()), float(ends.max())
        old = (edges[1:] > low) & (edges[:-1] < high) & (beams < SEEN) & ~found
        reach[old, 0] = edges[:-1][old].clip(low)
        reach[old, 1] = edges[1:][old].clip(None, high)
        found |= old
    ends = [(reach[low:high, 0].min(), reach[low:high, 1].max()) for low, high in runs(found)]
    stations = np.array([pair for pair in ends if pair[1] - pair[0] > SHORTEST]).reshape(-1, 2, 1)
    segments: Float = (middle + stations * unit).reshape(-1, 4)
    return segments


def runs(chosen: Bool) -> list[tuple[int, int]]:
    """The first place of each run of chosen ones (n,), and the place behind its last."""
    padded = np.zeros(len(chosen) + 2, np.bool_)
    padded[1:-1] = chosen
    edges = np.flatnonzero(padded[1:] != padded[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))
