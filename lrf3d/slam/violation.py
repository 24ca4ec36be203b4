"""Self-check: whether the key scans of a solved drive agree where the robot came by again.

Key scans and their poses enter; the share of points that beams of other scans pass through leaves,
for the whole drive and for its worst part. Poses that are wrong by more than a door's width put
rooms onto each other.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lrf3d.geometry import Float
from lrf3d.pose import between
from lrf3d.slam.key_scans import MOST_THROUGH, Key, most_through, seen_through_both

NEAR = 3.0
"""Key scans up to this far apart [m] are compared: most of what they see is the same."""

LATER = 20.0
"""Least path length [m] between key scans that are compared: adjacent ones agree in any case."""

COMPARED = 4
"""Most earlier key scans that each one is compared with, the nearest."""

PART = 20
"""Key scans in a part of a drive."""

MOST_THROUGH_PART = 0.2
"""Largest share of points that beams may pass in a part. A closed door, or a lorry that has left,
is seen by a few scans; and lasers of ten beams see corners where there are none."""


class SelfCheck(NamedTuple):
    """How well the scans of a solved drive agree with each other.

    Attributes:
        violation: Share of the points seen by one scan that beams of another pass through.
        worst_violation: The same in the worst part of the drive; 0 if fewer key scans than a part
            has could be compared.
        worst_scans: Numbers of the first and the last scan of that part.
        key_scans_compared: Number of key scans that could be compared with earlier ones.
        mixed_pixels: Share of points that beams pass through in adjacent scans.

    Examples:
        >>> from lrf3d.slam.violation import SelfCheck
        >>> check = SelfCheck(violation=0.06, key_scans_compared=500, mixed_pixels=0.005)
        >>> check.passed, check.sentences()[0].split(':')[0]
        (False, 'the map contradicts itself')
    """

    violation: float = 0.0
    worst_violation: float = 0.0
    worst_scans: tuple[int, int] = (0, 0)
    key_scans_compared: int = 0
    mixed_pixels: float = 0.0

    @property
    def passed(self) -> bool:
        """Whether nothing contradicts the poses."""
        most = most_through(self.mixed_pixels)
        return self.violation <= most and self.worst_violation <= MOST_THROUGH_PART

    def sentences(self) -> list[str]:
        """What is wrong, in a sentence; an empty list where nothing is."""
        first, last = self.worst_scans
        share = f"{100.0 * self.violation:.0f} % of what scans saw"
        where = f"beams of scans {first} to {last}"
        worst = f"{100.0 * self.worst_violation:.0f} % of what others saw"
        if self.violation > most_through(self.mixed_pixels):
            return [f"the map contradicts itself: beams pass through {share}; poses are wrong"]
        if not self.passed:
            return [f"{where} pass through {worst}: poses are wrong, or the world has changed"]
        if self.violation <= MOST_THROUGH:
            return []
        mixed = f"{100.0 * self.mixed_pixels:.1f} % in adjacent scans"
        doubt = f"the map may be wrong: beams pass through {share} ({mixed})"
        return [f"{doubt}; {where} pass through {worst}" if self.worst_violation else doubt]


def self_check(
    keys: Sequence[Key], poses: Float, driven: Float, mixed_pixels: float = 0.0
) -> SelfCheck:
    """Compare the key scans (k,) of a solved drive, at poses (k, 3), where the robot came by again.

    Driven (k,) is the distance at each of them [m].
    """
    scans, counts = [], []
    for number, key in enumerate(keys):
        apart = np.hypot(*(poses[:number, :2] - poses[number, :2]).T)
        near = np.flatnonzero((apart < NEAR) & (driven[:number] < driven[number] - LATER))
        near = near[np.argsort(apart[near], kind="stable")][:COMPARED]
        if len(near):
            olds = [keys[k] for k in near.tolist()]
            counts.append(seen_through_both(olds, key, between(poses[near], poses[number])))
            scans.append(key.scan)
    if not counts:
        return SelfCheck(mixed_pixels=mixed_pixels)
    part = min(PART, len(counts))
    through, seen = sliding_window_view(np.array(counts), part, axis=0).sum(axis=2).T
    shares = through / np.maximum(seen, 1)
    worst = int(shares.argmax())
    all_through, all_seen = np.sum(counts, axis=0).tolist()
    return SelfCheck(
        all_through / max(all_seen, 1),
        float(shares[worst]) if part == PART else 0.0,
        (scans[worst], scans[worst + part - 1]),
        len(counts),
        mixed_pixels,
    )
