"""Tracks: where a frame stood in another one over time, and frames that hang on each other.

Stamped places and turns in space enter, as ROS's tf has them; what leaves is interpolated at
whole nanoseconds, so that at a stamp it is just what was said for it.
"""

from array import array
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lrf3d.geometry import Bool, Float, Int


@dataclass(frozen=True, eq=False)
class Placed:
    """Where a frame stands in another at some times.

    Args:
        places: (n, 3) its origin [m].
        turns: Its turn at each of the times.
        known: (n,) whether anything is known of that time.
    """

    places: Float
    turns: Rotation
    known: Bool

    def __matmul__(self, other: "Placed") -> "Placed":
        """Compose: ``world_from_robot @ robot_from_laser`` is ``world_from_laser``."""
        return Placed(
            self.places + self.turns.apply(other.places),
            self.turns * other.turns,
            self.known & other.known,
        )

    @classmethod
    def identity(cls, count: int) -> "Placed":
        """The frame itself, at a number of times."""
        return cls(np.zeros((count, 3)), Rotation.identity(count), np.ones(count, np.bool_))

    def in_the_plane(self) -> tuple[Float, Float]:
        """Poses (n, 3) x, y, theta as seen from above, and how the z axis stands (n,).

        The latter is the cosine of its tilt: 1 upright, −1 upside down.
        """
        matrices = self.turns.as_matrix()
        theta = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
        return np.column_stack([self.places[:, :2], theta]), matrices[:, 2, 2]


class Rows:
    """Stamped places and turns as they come, packed: transforms come by the million."""

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
class Track:
    """A frame in another one over time.

    Args:
        times: (k,) stamps [ns], rising.
        places: (k, 3) its origin [m].
        turns: Its turn at each of the stamps.
        stands: Whether it stands as it was said once, at all times.
    """

    times: Int
    places: Float
    turns: Rotation
    stands: bool = False

    @classmethod
    def of(cls, rows: "Rows", *, stands: bool = False) -> "Track":
        """The track of rows in any order; of two at the same time the later counts."""
        stamps = np.array(rows.stamps, dtype=np.int64)
        values = np.array(rows.values, dtype=np.float64).reshape(-1, 7)
        times, last = np.unique(stamps[::-1], return_index=True)
        values = values[::-1][last]
        return cls(times, values[:, :3], Rotation.from_quat(values[:, 3:]), stands)

    @property
    def moves(self) -> bool:
        """Whether it is ever elsewhere than at first; fixed joints are published repeatedly too."""
        turns = self.turns.as_matrix()
        same = (self.places == self.places[0]).all() and (turns == turns[0]).all()
        return not (self.stands or same)

    def at(self, times: Int) -> Placed:
        """Where it was at times (n,) [ns]: straight and evenly turning between two stamps.

        Before its first stamp and after its last nothing is known of it.
        """
        if self.stands or len(self.times) == 1:
            row = np.zeros(len(times), np.int64)
            known = np.full(len(times), self.stands) | (times == self.times[0])
            return Placed(self.places[row], self.turns[row], known)
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self.times) - 1)
        before = after - 1
        span = self.times[after] - self.times[before]
        share = (times - self.times[before]) / span
        places = self.places[before]
        places = places + share[:, None] * (self.places[after] - places)
        start = self.turns[before]
        turn = (start.inv() * self.turns[after]).as_rotvec()
        turns = start * Rotation.from_rotvec(share[:, None] * turn)
        return Placed(places, turns, (times >= self.times[0]) & (times <= self.times[-1]))


class FrameTree:
    """Frames that hang on each other by tracks; each hangs on one parent."""

    def __init__(self, edges: dict[str, tuple[str, Track]]) -> None:
        self._edges = edges

    def chain(self, frame: str) -> list[str]:
        """The frame and those that it hangs on, up to the root."""
        frames = [frame]
        while frame in self._edges and self._edges[frame][0] not in frames:
            frame = self._edges[frame][0]
            frames.append(frame)
        return frames

    def moves(self, frame: str) -> bool:
        """Whether the frame moves against the root of its chain."""
        return any(self._edges[child][1].moves for child in self.chain(frame)[:-1])

    def placed(self, frame: str, above: str, times: Int) -> Placed:
        """The frame in one of those that it hangs on, at times (n,) [ns]."""
        result = Placed.identity(len(times))
        for child in self.chain(frame):
            if child == above:
                break
            result = self._edges[child][1].at(times) @ result
        return result
