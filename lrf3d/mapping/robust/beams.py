"""The beams that a robust mapper keeps, and the filter that drops a scan it has seen already.

A scan enters the archive unless one from almost the same pose is kept, so that the archive grows
with the ground that was covered and not with the time that was spent. Its beams leave as arrays
that compiled code takes.
"""

from collections.abc import Mapping
from hashlib import blake2b
from typing import Any, NamedTuple

import numpy as np

from lrf3d.compiling import inner
from lrf3d.geometry import Float, Int, wrap_angle
from lrf3d.laser import LaserScan, RangeNoise
from lrf3d.mapping.robust.constants import REMEMBERED_SCANS, SAME_HEADING, SAME_PLACE
from lrf3d.mapping.robust.walls import longer

LEAST_SCANS, LEAST_BEAMS = 64, 16384
"""How much a new archive has room for."""


class Beams(NamedTuple):
    """The beams of some scans.

    Args:
        places: (k, 2) where the laser was [m].
        reaches: (k,) the longest range of each scan [m].
        first: (k + 1,) the first beam of each scan.
        angles: (n,) directions of the beams [rad], rising within a scan.
        units: (n, 2) their unit vectors.
        ranges: (n,) ranges [m]; where nothing returned, minus the range that is free.
    """

    places: Float
    reaches: Float
    first: Int
    angles: Float
    units: Float
    ranges: Float


@inner
def range_deviation(noise: RangeNoise, reach: float) -> float:  # pragma: no cover
    """Standard deviation [m] of a range [m]."""
    deviation: float = np.sqrt(noise.floor * noise.floor + (noise.growth * reach) ** 2)
    return deviation


class ScanArchive:
    """Scans, their beams in arrays that grow in place."""

    def __init__(self) -> None:
        self._places = np.empty((LEAST_SCANS, 2))
        self._reaches = np.empty(LEAST_SCANS)
        self._first = np.zeros(LEAST_SCANS + 1, np.int64)
        self._angles = np.empty(LEAST_BEAMS)
        self._units = np.empty((LEAST_BEAMS, 2))
        self._ranges = np.empty(LEAST_BEAMS)
        self._count = 0
        self._kept: dict[tuple[int, int], list[tuple[float, float, float]]] = {}
        self._headings: list[float] = []

    def __len__(self) -> int:
        return self._count

    def add(self, scan: LaserScan, place: tuple[float, float]) -> None:
        """Keep the beams of a scan from a place [m], unless its like is kept."""
        if self._knows(*place, scan.pose.theta):
            return
        start, count = int(self._first[self._count]), len(scan.ranges)
        stop = start + count
        if self._count == len(self._places):
            self._places, self._reaches = longer(self._places), longer(self._reaches)
            self._first = longer(self._first)
        while stop > len(self._ranges):
            self._angles, self._ranges = longer(self._angles), longer(self._ranges)
            self._units = longer(self._units)
        angles, ranges = scan.angles, scan.ranges
        if count > 1 and (angles[1:] < angles[:-1]).any():
            order = np.argsort(angles, kind="stable")
            angles, ranges = angles[order], ranges[order]
        heading = self._angles[start:stop]
        np.add(angles, scan.pose.theta, out=heading)
        np.cos(heading, out=self._units[start:stop, 0])
        np.sin(heading, out=self._units[start:stop, 1])
        kept = self._ranges[start:stop]
        kept[:] = ranges
        # Where nothing returned all is free; nothing is known before what is too near.
        kept[kept > scan.range_max] = -scan.range_max if scan.range_max < np.inf else 0.0
        kept[~np.isfinite(kept)] = 0.0
        self._places[self._count] = place
        self._reaches[self._count] = np.abs(kept).max(initial=0.0)
        self._first[self._count + 1] = stop
        # Last, and with nothing in between: a scan is kept whole or, after an interrupt, not.
        self._keep(*place, scan.pose.theta)
        self._count += 1

    def _knows(self, x: float, y: float, theta: float) -> bool:
        """Whether a scan from almost this pose is kept."""
        column, row = int(x // SAME_PLACE), int(y // SAME_PLACE)
        for i in range(column - 1, column + 2):
            for k in range(row - 1, row + 2):
                for u, v, heading in self._kept.get((i, k), ()):
                    if (u - x) ** 2 + (v - y) ** 2 < SAME_PLACE**2:
                        if abs(wrap_angle(heading - theta)) < SAME_HEADING:
                            return True
        return False

    def _keep(self, x: float, y: float, theta: float) -> None:
        """Note that a scan from a pose is kept."""
        cell = int(x // SAME_PLACE), int(y // SAME_PLACE)
        self._kept.setdefault(cell, []).append((x, y, theta))
        self._headings.append(theta)

    def state(self) -> dict[str, Any]:
        """All that the archive is, as plain arrays by their names; `restore` takes them back."""
        beams = self.beams(self._count)._asdict()
        return {
            **{f"scan_{name}": column.copy() for name, column in beams.items()},
            "scan_headings": np.array(self._headings, dtype=np.float64),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Be the archive whose state is given."""
        beams = Beams(*(state[f"scan_{name}"].copy() for name in Beams._fields))
        # Arrays grow to twice their length, so that none may be without any.
        self._places, self._reaches, self._first = (
            np.concatenate([column, np.zeros((LEAST_SCANS, *column.shape[1:]), column.dtype)])
            for column in (beams.places, beams.reaches, beams.first)
        )
        self._angles, self._units, self._ranges = (
            np.concatenate([column, np.zeros((LEAST_BEAMS, *column.shape[1:]))])
            for column in (beams.angles, beams.units, beams.ranges)
        )
        self._count = len(beams.places)
        self._kept, self._headings = {}, []
        for (x, y), theta in zip(
            beams.places.tolist(), state["scan_headings"].tolist(), strict=True
        ):
            self._keep(x, y, theta)

    def beams(self, count: int) -> Beams:
        """The beams of the first scans."""
        last = int(self._first[count])
        return Beams(
            self._places[:count],
            self._reaches[:count],
            self._first[: count + 1],
            self._angles[:last],
            self._units[:last],
            self._ranges[:last],
        )


class DuplicateFilter:
    """Finds the very same scan given again, by a number of 64 bits for each of the latest scans."""

    def __init__(self) -> None:
        # A dict keeps its order, so that the oldest is known.
        self._seen: dict[int, None] = {}

    def add(self, scan: LaserScan) -> bool:
        """Remember a scan; returns whether it is new."""
        digest = blake2b(scan.ranges.tobytes(), digest_size=8)
        digest.update(scan.angles.tobytes())
        digest.update(np.array(scan.pose).tobytes())
        fingerprint = int.from_bytes(digest.digest(), "little", signed=True)
        if fingerprint in self._seen:
            return False
        if len(self._seen) >= REMEMBERED_SCANS:
            del self._seen[next(iter(self._seen))]
        self._seen[fingerprint] = None
        return True

    def state(self) -> Int:
        """The numbers, the oldest first."""
        return np.fromiter(self._seen, np.int64, len(self._seen))

    def restore(self, state: Int) -> None:
        """Remember just these."""
        self._seen = dict.fromkeys(state.tolist())
