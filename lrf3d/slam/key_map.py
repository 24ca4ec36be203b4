"""Key map: the map of key scans, which is drawn anew in pieces where their poses have moved.

Key scans and their poses enter as the drive goes on; the map leaves whenever it is read. A mapper
cannot take a scan out of its map. So when closed loops move key scans, all are mapped again in
their new places, but not at once: those around the robot first, then a few after each scan. Until
all are done, the map shows each place as drawn anew if its key scan is done; if not, it shows the
old segments, moved along with the key scan next to them.
"""

from collections.abc import Callable

import numpy as np
from scipy.spatial import KDTree

from lrf3d.geometry import Bool, Float, Int
from lrf3d.laser import LaserScan
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.slam.frames import between, compose

REDRAWN = 0.02
"""The map is drawn anew once a key scan has moved by more than this [m]."""

AT_ONCE = 24
"""Key scans that are mapped again at once, those nearest to the robot: some 12 m of its way."""

EACH_SCAN = 2
"""Key scans that are mapped again after each further scan, as long as there are any: that takes as
long as following the robot does."""

PIECE = 2.0
"""Length of the pieces [m] in which old walls follow their key scans until they are drawn anew."""


class _Drawing:
    """A mapper, the key scans that it is to take in, and their poses in its map."""

    def __init__(self, keys: Int, poses: Float) -> None:
        self.mapper = LineMapper()
        # In the order in which they are taken in; and their poses (k, 3), by their numbers.
        self.order = keys.tolist()
        self.poses = poses
        self.planned = 0
        self.done = 0
        # Finds the key scan next to a place, once that is asked for.
        self.places: KDTree | None = None

    def draw(self, placed: Callable[[int, Float], LaserScan]) -> LineMap:
        """The map of the key scans that are to be in it by now."""
        for number in self.order[self.done : self.planned]:
            self.mapper.update(placed(number, self.poses[number]))
        self.done = self.planned
        return self.mapper.map


class KeyMap:
    """The map of key scans at poses that move.

    Nothing is mapped before the map is read, and the map does not depend on when it was read.

    Args:
        placed: Returns the key scan of a number with the pose of its laser in the world, where the
            robot is at a pose (3,) since the start.
        start: (3,) pose x, y [m], theta [rad] of the start in the world.
    """

    def __init__(self, placed: Callable[[int, Float], LaserScan], start: Float) -> None:
        self._placed = placed
        self._start = start
        self._now = _Drawing(np.empty(0, np.int64), np.empty((0, 3)))
        self._next: _Drawing | None = None
        self._poses = np.empty((0, 3))

    def update(self, poses: Float, robot: Float) -> None:
        """Take in the current poses of the key scans, before `go_on`.

        Args:
            poses: (k, 3) poses since the start of all key scans, old and new.
            robot: (3,) pose of the robot since the start.
        """
        self._poses = poses
        for drawing in (self._now, self._next):
            if drawing is not None:
                self._add_new(drawing)
        self._now.planned = len(self._now.order)
        if self._next is None and self._has_moved(self._now):
            apart = np.hypot(poses[:, 0] - robot[0], poses[:, 1] - robot[1])
            self._next = _Drawing(np.argsort(apart, kind="stable"), poses.copy())
            self._next.planned = AT_ONCE - EACH_SCAN

    def go_on(self) -> None:
        """Go on drawing anew, after each scan."""
        if self._next is not None:
            self._next.planned += EACH_SCAN
            if self._next.planned >= len(self._next.order):
                self._next.planned = len(self._next.order)
                self._now, self._next = self._next, None

    def redraw(self, poses: Float) -> None:
        """Draw all anew, in the order of the key scans."""
        self._poses = poses
        self._now, self._next = _Drawing(np.arange(len(poses)), poses.copy()), None
        self._now.planned = len(poses)

    def map(self) -> LineMap:
        """The map as it is now."""
        now = self._now.draw(self._placed)
        if self._next is None:
            return now
        new = self._next.draw(self._placed)
        done = np.zeros(len(self._poses), np.bool_)
        done[self._next.order[: self._next.planned]] = True
        parts = self._moved(self._now, now, ~done), self._moved(self._next, new, done)
        (old_segments, old), (new_segments, fresh) = parts
        return LineMap(
            np.concatenate([old_segments, new_segments]),
            np.concatenate([now.objects[old], new.objects[fresh] + now.object_count]),
            np.concatenate([now.points[old], new.points[fresh]]),
            np.concatenate([now.kinds[old], new.kinds[fresh]]),
        )

    def _add_new(self, drawing: _Drawing) -> None:
        """Put new key scans into a drawing, each as it stands to the key scan next to it."""
        for number in range(len(drawing.poses), len(self._poses)):
            pose = self._poses[number]
            if number:
                apart = self._poses[:number, :2] - pose[:2]
                beside = int(np.hypot(apart[:, 0], apart[:, 1]).argmin())
                if _apart(drawing.poses[beside], self._poses[beside]) > REDRAWN:
                    pose = compose(drawing.poses[beside], between(self._poses[beside], pose))
            drawing.poses = np.concatenate([drawing.poses, pose[None]])
            drawing.order.append(number)

    def _has_moved(self, drawing: _Drawing) -> bool:
        """Whether key scans have moved since the drawing took them in."""
        return bool((_apart(drawing.poses, self._poses) > REDRAWN).any())

    def _moved(self, drawing: _Drawing, line_map: LineMap, shown: Bool) -> tuple[Float, Int]:
        """The segments of a drawing, moved to where its key scans stand now.

        Args:
            drawing: The drawing.
            line_map: Its map.
            shown: (k,) the key scans whose surroundings it shows.

        Returns:
            Segments (s, 4) [m], moved with the key scans next to them, and for each the number
            (s,) of the segment of the map that it is part of.
        """
        then, now = compose(self._start, drawing.poses), compose(self._start, self._poses)
        starts, ways = line_map.segments[:, :2], line_map.segments[:, 2:] - line_map.segments[:, :2]
        # A long wall passes many key scans: it follows, piece by piece, the one that is next to it.
        counts = 1 + (np.hypot(ways[:, 0], ways[:, 1]) / PIECE).astype(np.int64)
        source = np.repeat(np.arange(len(counts)), counts)
        first = np.concatenate([[True], source[1:] != source[:-1]])[: len(source)]
        number = np.arange(len(source)) - np.flatnonzero(first)[source]
        middles = starts[source] + ((number + 0.5) / counts[source])[:, None] * ways[source]
        if drawing.places is None or drawing.places.n != len(then):
            # Balancing the tree takes longer than it saves.
            drawing.places = KDTree(then[:, :2], balanced_tree=False, compact_nodes=False)
        key = np.asarray(drawing.places.query(middles)[1], dtype=np.int64)
        # Pieces that follow each other in one segment are shown as one.
        kept = shown[key]
        begins = kept & (first | ~np.roll(kept, 1))
        ends = kept & np.roll(first | ~kept, -1)
        ends[-1:] |= kept[-1:]
        steps = compose(now, between(then, np.zeros(3)))
        segments = np.empty((int(begins.sum()), 4))
        for end, pieces, past in ((slice(0, 2), begins, 0), (slice(2, 4), ends, 1)):
            of, share = source[pieces], (number[pieces] + past) / counts[source[pieces]]
            place = np.zeros((len(of), 3))
            place[:, :2] = starts[of] + share[:, None] * ways[of]
            segments[:, end] = compose(steps[key[pieces]], place)[:, :2]
        return segments, source[begins]


def _apart(first: Float, second: Float) -> Float:
    """Distances (…) between the places of poses (…, 3) [m]."""
    steps = second - first
    return np.asarray(np.hypot(steps[..., 0], steps[..., 1]))
