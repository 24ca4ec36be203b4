"""Violation: beams of one scan that pass through what another scan saw.

Key scans and their relative poses enter. Of the points that one scan saw, the number that lies in
view of the other leaves, and the number of these that the other's beams pass through. With right
poses hardly any are: poses that are wrong by more than a door's width put rooms onto each other.
So a solved drive is checked where the robot came by again, as a whole and in its worst part.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from lrf3d.geometry import Float
from lrf3d.pose import between
from lrf3d.slam.views import Key, views_of

MOST_THROUGH = 0.04
"""Share of points that beams may pass through: doors open and people walk."""

FARTHER_OFF, ENOUGH_SEEN = 2.0, 1000
"""Factor on the share of mixed pixels: from farther off more beams meet edges than in adjacent
scans. The share counts fully once it is that of so many points."""

NEAR = 3.0
"""Key scans up to this far apart [m] are compared: most of what they see is the same."""

LATER = 20.0
"""Least path length [m] between key scans that are compared: adjacent ones agree in any case."""

COMPARED = 4
"""Earlier key scans that each one is compared with at most, the nearest."""

PART = 20
"""Key scans that a part of a drive has."""

MOST_THROUGH_PART = 0.2
"""Share of points that beams may pass through in such a part. A closed door, or a lorry that has
left, is seen by a few scans; and lasers of ten beams see corners where there are none."""


def seen_through_both(olds: Sequence[Key], new: Key, poses: Float) -> tuple[int, int]:
    """How many points of a key scan and of others the other sees through, and has in view.

    The poses (k, 3) are those of the key scan as seen from the others.
    """
    views = [views_of(new.surface, poses, olds).ravel()]
    for old, back in zip(olds, between(poses, np.zeros(3)), strict=True):
        views.append(views_of(old.surface, back[None], [new])[0])
    counts = np.bincount(np.concatenate(views), minlength=4)
    return int(counts[2]), int(counts[1:].sum())


class MixedPixels:
    """The share of points that beams pass through at right places: that of adjacent key scans.

    Beams that meet two surfaces, hedges and glass make it what it is, in each recording another.
    """

    def __init__(self) -> None:
        self._through = self._seen = 0

    def learn(self, olds: Sequence[Key], new: Key) -> None:
        """Take in a key scan and those just before it, at their poses by the front end."""
        if len(olds):
            poses = between(np.array([key.pose for key in olds]), new.pose)
            through, seen = seen_through_both(olds, new, poses)
            self._through, self._seen = self._through + through, self._seen + seen

    @property
    def rate(self) -> float:
        """That share; 0 before anything was learnt."""
        return self._through / max(self._seen, ENOUGH_SEEN)

    def contradict(self, olds: Sequence[Key], new: Key, poses: Float) -> bool:
        """Whether beams pass through more points than at a right place.

        The arguments are those of `seen_through_both`.
        """
        through, seen = seen_through_both(olds, new, poses)
        return through > most_through(self.rate) * max(seen, 1)


def most_through(rate: float) -> float:
    """Largest share of points that beams may pass through, by that of mixed pixels."""
    return MOST_THROUGH + FARTHER_OFF * rate


class SelfCheck(NamedTuple):
    """How well the scans of a solved drive agree with each other.

    Attributes:
        violation: Share of the points seen by one scan that beams of another pass through.
        worst_violation: The same in the worst part of the drive; 0 if fewer key scans than a part
            has could be compared.
        worst_scans: Numbers of the first and the last scan of that part.
        key_scans_compared: How many key scans could be compared with earlier ones.
        mixed_pixels: The share of points that beams pass through in adjacent scans.

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
        share = f"{100.0 * self.violation:.0f} % of what scans saw"
        if self.violation > most_through(self.mixed_pixels):
            return [f"the map contradicts itself: beams pass through {share}; poses are wrong"]
        where = f"beams of scans {self.worst_scans[0]} to {self.worst_scans[1]}"
        worst = f"{100.0 * self.worst_violation:.0f} % of what others saw"
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

    Driven (k,) is how far the robot had driven at each of them [m]; the share of mixed pixels is
    that of adjacent scans.
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
