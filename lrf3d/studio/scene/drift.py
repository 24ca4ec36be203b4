"""Drift: the path by odometry alone, which starts again from the estimate where a loop closes.

The estimate of a run enters; the ghost of the robot, its path, and what each loop removed leave.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lrf3d.geometry.lines import Float
from lrf3d.geometry.pose import between, compose
from lrf3d.studio.scene.bodies import flat_dart
from lrf3d.studio.scene.look import BOLD, TINY, TRAIL_HEIGHT, rgb
from lrf3d.studio.scene.marks import trail_lines
from lrf3d.studio.scene.shapes import Lines, Soft, level_lines
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.timeline import DriveKeys, interpolated

# Colour of the path by odometry: paler than all others, as it is a ghost.
GHOST_COLOUR = rgb("#a9c4ff")

# Time for which a loop is shown as it closes [s of the film].
CLOSING_TIME = 2.4

# Least distance that a loop removes to be reported [m]: less is not seen in a picture.
_SEEN = 0.02

# Least distance by which a loop moves the estimate so that it is seen to close [m].
CLOSES = 0.5

# Opacity of the ghost of the robot.
_GHOST = 0.55

# Size of that ghost [m].
_GHOST_SIZE = 0.5

# Distance from the robot from which on its ghost is fully seen [m].
_APART = 0.3


class Drift(NamedTuple):
    """How odometry drifts off the estimate of a run, and the loops that remove it."""

    # The path by odometry; it jumps where a loop closes.
    keys: DriveKeys
    # The path of the estimate.
    believed: DriveKeys
    # (c,) times at which loops close, from the start of the run on [s].
    times: Float
    # (c, 4) from where odometry led to where the loop puts the robot, in the film's frame [m].
    jumps: Float
    # The path by odometry if no loop were closed.
    alone: DriveKeys
    # Its distance from the estimate at the end [m].
    total: float

    @property
    def removed(self) -> Float:
        """How much drift each loop removed (c,) [m]."""
        return np.asarray(np.hypot(*(self.jumps[:, 2:] - self.jumps[:, :2]).T))

    @classmethod
    def of(cls, run: Shown, origin: Float, playback: float) -> "Drift | None":
        """The drift of a run in a frame with an origin (2,); None where it is not known.

        Loops that close soon after one another [s of the run in a second of the film] are one.
        """
        estimate = run.estimate
        if estimate is None or len(estimate.odometry) < 2:
            return None
        poses = estimate.poses - [*origin, 0.0]
        odometry = estimate.odometry
        times = run.trajectory.times - run.trajectory.times.min()
        closed = list[int]()
        for scan in np.unique(estimate.closures.max(axis=1, initial=0)).tolist():
            if scan and (not closed or times[scan] - times[closed[-1]] > CLOSING_TIME * playback):
                closed.append(scan)
        parts = list[tuple[Float, Float]]()
        bounds = [0, *closed, len(poses) - 1]
        for first, last in pairwise(bounds):
            path = compose(poses[first], between(odometry[first], odometry[first : last + 1]))
            when = times[first : last + 1].copy()
            when[0] += TINY * (first > 0)
            parts.append((when, path))
        ends = np.array([path[-1, :2] for _, path in parts[:-1]]).reshape(-1, 2)
        jumps = np.hstack([ends, poses[closed, :2]])
        alone = DriveKeys(times, compose(poses[0], between(odometry[0], odometry)))
        steps, paths = map(np.concatenate, zip(*parts, strict=True))
        paths[:, 2] = np.unwrap(paths[:, 2])
        seen = np.hypot(*(jumps[:, 2:] - jumps[:, :2]).T) > _SEEN
        keys = DriveKeys(steps, paths)
        total = float(np.hypot(*(alone.poses[-1] - poses[-1])[:2]))
        believed = DriveKeys(times, poses)
        return cls(keys, believed, times[closed][seen], jumps[seen], alone, total)

    def off(self, time: float) -> float:
        """How far odometry alone is off the estimate at a time [s], since the last loop [m]."""
        now = np.array([time])
        ghost, robot = (
            interpolated(now, keys.times, keys.poses[:, :2]) for keys in (self.keys, self.believed)
        )
        return float(np.hypot(*(ghost - robot)[0]))

    def ghost(self, time: float) -> Soft:
        """The robot where odometry alone puts it at a time [s]."""
        (pose,) = interpolated(np.array([time]), self.keys.times, self.keys.poses)
        dart = flat_dart(pose, _GHOST_SIZE, 2.0 * TRAIL_HEIGHT, GHOST_COLOUR)
        # Only the pale dart, without its dark rim, and none of it under the robot.
        colours = dart.colours[2:].copy()
        colours[..., 3] = _GHOST * min(self.off(time) / _APART, 1.0)
        return Soft(dart.corners[2:], colours)

    def trail(self, time: float, fade: float) -> Lines:
        """The path by odometry since the last loop before a time [s]; all of it at the end."""
        if time >= self.alone.times[-1]:
            return trail_lines(self.alone, time, fade, GHOST_COLOUR)
        past = self.times[self.times <= time]
        since = self.keys.times > past.max(initial=-1.0)
        return trail_lines(
            DriveKeys(*(each[since] for each in self.keys)), time, fade, GHOST_COLOUR
        )

    def closings(self, time: float, lasting: float) -> Lines:
        """Lines along which loops have just moved the robot at a time, fading in a time [s]."""
        age = (time - self.times) / lasting
        past = (age >= 0.0) & (age < 1.0)
        fresh = 1.0 - age[past]
        starts, ends = np.hsplit(self.jumps[past], 2)
        opacities = np.column_stack([fresh, fresh])
        return level_lines(
            2.0 * TRAIL_HEIGHT, starts, ends, np.ones((len(starts), 3)), opacities, BOLD
        )
