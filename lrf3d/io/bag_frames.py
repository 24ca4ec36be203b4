"""Frames of a bag: the pose of each in its parent over time, and along chains of them.

Stamped transforms enter, in the order of the bag; poses at the times of the scans leave.
"""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lrf3d.geometry import Bool, Float, Int


@dataclass(frozen=True, eq=False)
class Placed:
    """Origins (n, 3) [m] and rotations of a frame in another one at n times, where known (n,)."""

    places: Float
    rotations: Rotation
    known: Bool

    def __matmul__(self, other: "Placed") -> "Placed":
        """Compose: ``world_from_robot @ robot_from_laser`` is ``world_from_laser``."""
        return Placed(
            self.places + self.rotations.apply(other.places),
            self.rotations * other.rotations,
            self.known & other.known,
        )

    @classmethod
    def identity(cls, count: int) -> "Placed":
        """The identity at a number of times."""
        return cls(np.zeros((count, 3)), Rotation.identity(count), np.ones(count, np.bool_))

    def in_the_plane(self) -> tuple[Float, Float]:
        """Poses (n, 3) x, y, theta in the plane, and the cosine of the z axis's tilt (n,).

        The cosine is 1 for an upright frame and −1 for one upside down.
        """
        matrices = self.rotations.as_matrix()
        theta = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
        return np.column_stack([self.places[:, :2], theta]), matrices[:, 2, 2]


class Rows:
    """Stamped poses in the order of the bag, packed: a bag holds millions of transforms."""

    def __init__(self) -> None:
        self.stamps = array("q")
        self.values = array("d")

    def __len__(self) -> int:
        return len(self.stamps)

    def add(self, stamp: int, values: Iterable[float]) -> None:
        """Add a stamp [ns] with x, y, z [m] and a quaternion x, y, z, w."""
        self.stamps.append(stamp)
        self.values.extend(values)


@dataclass(frozen=True, eq=False)
class FrameTrack:
    """The pose of a frame in another one at ascending stamps (k,) [ns], or at all times."""

    times: Int
    places: Float
    rotations: Rotation
    is_static: bool = False

    @classmethod
    def of(cls, rows: "Rows", *, is_static: bool = False) -> "FrameTrack":
        """The track of rows in any order; the later of two with the same stamp counts."""
        stamps = np.array(rows.stamps, dtype=np.int64)
        values = np.array(rows.values, dtype=np.float64).reshape(-1, 7)
        times, last = np.unique(stamps[::-1], return_index=True)
        values = values[::-1][last]
        return cls(times, values[:, :3], Rotation.from_quat(values[:, 3:]), is_static)

    @property
    def moves(self) -> bool:
        """Whether its pose ever changes; fixed joints may be published repeatedly."""
        rotations = self.rotations.as_matrix()
        same = (self.places == self.places[0]).all() and (rotations == rotations[0]).all()
        return not (self.is_static or same)

    def at(self, times: Int) -> Placed:
        """Its poses at times (n,) [ns], interpolated linearly between two stamps.

        Before the first stamp and after the last they are unknown.
        """
        if self.is_static or len(self.times) == 1:
            row = np.zeros(len(times), np.int64)
            known = np.full(len(times), self.is_static) | (times == self.times[0])
            return Placed(self.places[row], self.rotations[row], known)
        first, last = self.times[0], self.times[-1]
        # Seconds from the first stamp: float64 has no room for nanoseconds since 1970.
        own, asked = 1e-9 * (self.times - first), 1e-9 * (np.clip(times, first, last) - first)
        places = np.column_stack([np.interp(asked, own, column) for column in self.places.T])
        rotations = Slerp(own, self.rotations)(asked)
        return Placed(places, rotations, (times >= first) & (times <= last))


class FrameTree:
    """Frames with their tracks; each frame has one parent."""

    def __init__(self, edges: dict[str, tuple[str, FrameTrack]]) -> None:
        self._edges = edges

    def chain(self, frame: str) -> list[str]:
        """The frame and its ancestors, up to the root."""
        frames = [frame]
        while frame in self._edges and self._edges[frame][0] not in frames:
            frame = self._edges[frame][0]
            frames.append(frame)
        return frames

    def moves(self, frame: str) -> bool:
        """Whether the frame moves relative to the root of its chain."""
        return any(self._edges[child][1].moves for child in self.chain(frame)[:-1])

    def placed(self, frame: str, above: str, times: Int) -> Placed:
        """Poses of the frame in one of its ancestors at times (n,) [ns]."""
        result, chain = Placed.identity(len(times)), self.chain(frame)
        for child in chain[: chain.index(above)]:
            result = self._edges[child][1].at(times) @ result
        return result
