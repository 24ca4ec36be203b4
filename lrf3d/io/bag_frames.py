"""Frames of a bag: the pose of each in its parent over time, and along chains of them.

Stamped transforms enter, in the order of the bag; poses at the times of the scans leave, as
matrices (n, 4, 4) that are NaN where a pose is unknown.
"""

from array import array
from collections.abc import Iterable, Mapping

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lrf3d.geometry import Float, Int


class FrameTrack:
    """The stamped poses of a frame in another one, packed: a bag holds millions of transforms."""

    def __init__(self, *, is_static: bool = False) -> None:
        self._stamps, self._rows, self._is_static = array("q"), array("d"), is_static

    def add(self, stamp: int, row: Iterable[float]) -> None:
        """Add x, y, z [m] and a quaternion x, y, z, w at a stamp [ns], in any order."""
        self._stamps.append(stamp)
        self._rows.extend(row)

    @property
    def moves(self) -> bool:
        """Whether its pose ever changes; fixed joints may be published repeatedly."""
        _, places, rotations = self._sorted()
        matrices = _matrices(places, rotations)
        return not (self._is_static or (matrices == matrices[0]).all())

    def at(self, times: Int) -> Float:
        """Its poses (n, 4, 4) at times (n,) [ns], interpolated linearly between two stamps.

        They are unknown before the first stamp and after the last; those of a static frame never
        change.
        """
        stamps, places, rotations = self._sorted()
        first, last = stamps[[0, -1]]
        if self._is_static or len(stamps) == 1:
            matrices = np.tile(_matrices(places[:1], rotations[:1]), (len(times), 1, 1))
        else:
            # Seconds from the first stamp: float64 has no room for nanoseconds since 1970.
            own, asked = 1e-9 * (stamps - first), 1e-9 * (np.clip(times, first, last) - first)
            between = np.column_stack([np.interp(asked, own, column) for column in places.T])
            matrices = _matrices(between, Slerp(own, rotations)(asked))
        if not self._is_static:
            matrices[(times < first) | (times > last)] = np.nan
        return matrices

    def _sorted(self) -> tuple[Int, Float, Rotation]:
        """Ascending stamps, places and rotations; the later row of the same stamp counts."""
        rows = np.array(self._rows).reshape(-1, 7)[::-1]
        stamps, kept = np.unique(np.array(self._stamps)[::-1], return_index=True)
        return stamps, rows[kept, :3], Rotation.from_quat(rows[kept, 3:])


Edges = Mapping[str, tuple[str, FrameTrack]]
"""The parent of each frame, and the frame's track in it."""


def chain(edges: Edges, frame: str) -> list[str]:
    """The frame and its ancestors, up to the root."""
    frames = [frame]
    while frame in edges and edges[frame][0] not in frames:
        frame = edges[frame][0]
        frames.append(frame)
    return frames


def placed(edges: Edges, frame: str, above: str, times: Int) -> Float:
    """Poses (n, 4, 4) of the frame in one of its ancestors at times (n,) [ns]."""
    result, frames = np.tile(np.eye(4), (len(times), 1, 1)), chain(edges, frame)
    for child in frames[: frames.index(above)]:
        result = edges[child][1].at(times) @ result
    return result


def in_the_plane(matrices: Float) -> Float:
    """Poses (n, 3) x, y, theta in the plane of frames (n, 4, 4)."""
    theta = np.arctan2(matrices[:, 1, 0], matrices[:, 0, 0])
    return np.column_stack([matrices[:, :2, 3], theta])


def _matrices(places: Float, rotations: Rotation) -> Float:
    matrices = np.tile(np.eye(4), (len(places), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = rotations.as_matrix(), places
    return matrices
