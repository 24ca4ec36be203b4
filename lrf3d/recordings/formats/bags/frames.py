"""The frames of a bag: their stamped poses in one another, and the tree that transforms make."""

import math
from array import array
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lrf3d.base.errors import InputError
from lrf3d.base.units import NANO
from lrf3d.geometry.lines import LARGEST_COORDINATE, Bool, Float, Int

# A stamp earlier than the one before it by more than this [ns] begins another part of a recording:
# messages that overtake each other differ by less.
BACK = 1_000_000_000

# How far the norm of a quaternion may be from 1: people type mounts as 0.7 0.7.
UNEVEN = 0.02

# Poses are unknown in a gap that is longer than `BACK` and than this many usual intervals.
GAPS = 5


@dataclass(frozen=True, slots=True)
class BagPart:
    """A part of a recording: the messages at which later parts begin, and its number from 0.

    All parts but the first have an entry in ``begins``. If ``by_receipt`` is set, the times at
    which the recorder received messages replace their stamps.
    """

    begins: Int
    number: int
    by_receipt: bool = False


class FrameTrack:
    """When messages were sent and received, and the poses of a frame in another, if they hold any.

    It is stored in packed arrays: a bag holds millions of transforms.
    """

    def __init__(self, *, is_static: bool = False) -> None:
        self._stamps = array("q")
        self._rows = array("d")
        self.is_static = is_static

    def __len__(self) -> int:
        return len(self._stamps) // 3

    def add(self, sent: int, received: int, number: int) -> None:
        """Add the times [ns] of the next message that was received, and its number in the bag."""
        self._stamps.extend((sent, received, number))

    def add_pose(self, place: Any, turn: Any, *stamp: int) -> None:
        """Add a position and a quaternion at a time, in any order."""
        row = place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w
        # Written this way round, the comparisons refuse NaN as well. The norm shows where a heading
        # was written in place of a quaternion's z.
        if not (
            all(abs(value) <= LARGEST_COORDINATE for value in row)
            and abs(math.hypot(*row[3:]) - 1.0) < UNEVEN
        ):
            raise InputError(f"pose {row}: expected numbers and a unit quaternion")
        self.add(*stamp)
        self._rows.extend(row)

    @property
    def stamps(self) -> Int:
        """When messages were sent and received [ns], and their numbers in the bag (3, n)."""
        return np.array(self._stamps, dtype=np.int64).reshape(-1, 3).T

    @property
    def stamps_repeat(self) -> int:
        """The number of different stamps if the sender's clock is too coarse or stands; else 0."""
        known = len(np.unique(self.stamps[0]))
        repeat = len(self) > 2 and 2 * known < len(self) and not self.stands
        return known if repeat else 0

    @property
    def stands(self) -> bool:
        """Whether it holds poses that are all the same, as those of a mount are."""
        rows = np.array(self._rows).reshape(-1, 7)
        return len(rows) > 0 and bool((rows == rows[0]).all())

    def ahead(self) -> float:
        """How far the sender's clock is ahead of the recorder's [ns], by the median."""
        sent, received, _ = self.stamps
        return float(np.median(sent - received))

    def times(self, part: BagPart) -> tuple[Int, Bool]:
        """Times (n,) [ns] of the messages, and which of them are in a part.

        Streams do not all go back at the same message: a run of rising stamps belongs to the part
        in which most of it was received.
        """
        sent, received, numbers = self.stamps
        place = np.searchsorted(part.begins, numbers, side="right")
        run = np.cumsum(np.diff(sent, prepend=sent[:1]) < -BACK)
        votes = np.zeros((run.max(initial=0) + 1, len(part.begins) + 1), dtype=np.int64)
        np.add.at(votes, (run, place), 1)
        inside = votes.argmax(axis=1)[run] == part.number
        return received if part.by_receipt else sent, inside

    def within(self, part: BagPart) -> "FrameMotion | None":
        """Its motion in a part of the recording; None if it was not published there.

        Of rows with the same stamp the later one counts. A static pose is valid in all parts.
        """
        times, inside = self.times(part)
        if self.is_static:
            inside = np.ones(len(times), dtype=np.bool_)
        rows = np.array(self._rows).reshape(-1, 7)[inside][::-1]
        times, kept = np.unique(times[inside][::-1], return_index=True)
        return FrameMotion(times, rows[kept], self.is_static) if len(times) else None


@dataclass(frozen=True)
class FrameMotion:
    """Poses of a frame in another one: x, y, z [m] and a quaternion (n, 7) at rising times [ns]."""

    times: Int
    rows: Float
    is_static: bool

    @cached_property
    def moves(self) -> bool:
        """Whether its pose ever changes; fixed joints may be published repeatedly."""
        matrices = _matrices(self.rows)
        return not (self.is_static or (matrices == matrices[0]).all())

    def at(self, times: Int) -> Float:
        """Its poses (k, 4, 4) at times (k,) [ns], interpolated linearly between two stamps.

        They are unknown before the first stamp and after the last; those of a fixed
        frame are each valid until the next.
        """
        first, last = self.times[[0, -1]]
        if not self.moves:
            latest = np.searchsorted(self.times, times, side="right") - 1
            matrices = _matrices(self.rows[np.maximum(latest, 0)])
        else:
            # Seconds from the first stamp: float64 has no room for nanoseconds since 1970.
            own = NANO * (self.times - first)
            asked = NANO * (np.clip(times, first, last) - first)
            between = np.column_stack([np.interp(asked, own, each) for each in self.rows.T[:3]])
            turns = Slerp(own, Rotation.from_quat(self.rows[:, 3:]))(asked)
            matrices = _matrices(np.column_stack([between, turns.as_quat()]))
            matrices[(times < first) | (times > last)] = np.nan
            steps = np.diff(self.times)
            place = np.clip(np.searchsorted(self.times, times), 1, len(steps)) - 1
            # Poses at a stamp are known, also at the ends of a gap.
            known = self.times[np.minimum(np.searchsorted(self.times, times), len(steps))] == times
            lost = steps[place] > max(BACK, GAPS * float(np.median(steps)))
            matrices[lost & ~known] = np.nan
        return matrices


def _matrices(rows: Float) -> Float:
    matrices = np.tile(np.eye(4), (len(rows), 1, 1))
    matrices[:, :3, :3] = Rotation.from_quat(rows[:, 3:]).as_matrix()
    matrices[:, :3, 3] = rows[:, :3]
    return matrices


class Frames:
    """A tree of frames in a part of a recording: the parent of each, and its motion in it."""

    def __init__(self, edges: Mapping[str, tuple[str, FrameTrack]], part: BagPart) -> None:
        motions = {child: (above, track.within(part)) for child, (above, track) in edges.items()}
        self._edges = {k: (above, motion) for k, (above, motion) in motions.items() if motion}
        self._known = {*self._edges, *(parent for parent, _ in self._edges.values())}

    def __contains__(self, frame: str) -> bool:
        return frame in self._known

    def chain(self, frame: str) -> list[str]:
        """The frame and its ancestors, up to the root."""
        frames = [frame]
        while frame in self._edges and self._edges[frame][0] not in frames:
            frame = self._edges[frame][0]
            frames.append(frame)
        return frames

    def moves(self, frame: str) -> bool:
        """Whether a frame moves in its parent."""
        return frame in self._edges and self._edges[frame][1].moves

    def base(self, frame: str) -> str:
        """The farthest ancestor that a frame is rigidly mounted on."""
        chain = self.chain(frame)
        return next((each for each in chain if self.moves(each)), chain[-1])

    def carries(self, frame: str, laser: str) -> bool:
        """Whether a frame is an ancestor of a laser's, or is rigidly joined to it."""
        return frame in self.chain(laser) or self.base(frame) == self.base(laser)

    def poses(self, frame: str, other: str, times: Int) -> Float:
        """Poses (n, 4, 4) of a frame in another one of its tree at times (n,) [ns]."""
        above = self.chain(other)
        common = next(each for each in self.chain(frame) if each in above)
        return np.linalg.inv(self._up(other, common, times)) @ self._up(frame, common, times)

    def _up(self, frame: str, above: str, times: Int) -> Float:
        result = np.tile(np.eye(4), (len(times), 1, 1))
        chain = self.chain(frame)
        for child in chain[: chain.index(above)]:
            result = self._edges[child][1].at(times) @ result
        return result


def in_the_plane(matrices: Float) -> Float:
    """Poses (n, 3) x, y, theta in the plane of frames (n, 4, 4)."""
    theta = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, :2, 3], theta])
