"""Drift: where odometry alone puts the robot, and all that its laser has met.

The estimate of a run enters; the path by odometry, what was hit from there, and the loop that shows
best how far it drifts leave.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from lrf3d.geometry.lines import Float, Int, cross
from lrf3d.geometry.pose import between, compose
from lrf3d.studio.scene.look import BOLD, TRAIL_HEIGHT, rgb
from lrf3d.studio.scene.marks import TRAIL_FADE, trail_lines
from lrf3d.studio.scene.shapes import Mark, Points, level_lines, single
from lrf3d.studio.scene.shown import Shown
from lrf3d.studio.scene.timeline import DriveKeys, Moment, interpolated, metres, smoothed

# Colour of all that is where odometry alone puts it.
GHOST_COLOUR = rgb("#ff4d26")

# Least drift that is seen where a loop closes, in the extent of the loop, which is the most.
_SEEN = 0.06

# Least area that a loop encloses, in that of a circle as long: what goes round twice has half.
_ROUND = 0.6

# Largest distance between its ends, in its length: an arc or a bend is not closed.
_OPEN = 0.2

# A loop is as large as others, in what the largest one encloses.
_LARGE = 0.9

# Number of hits that odometry alone puts astray, about.
_HITS = 24_000

# Diameter of these hits [m], and at least and at most [pixels of 720 lines].
_HIT_SIZE = 0.08, (2.0, 5.0)

# Shots that show these hits.
_SHOTS = ("proof", "rise", "whole", "end")

# Opacity of these hits.
_OPAQUE = 0.8

# Largest drift that is magnified, in the extent of the path: a larger one is seen anyway.
_SMALL = 0.04

# Width of what is magnified, in that drift.
_MAGNIFIED = 5.0

# Time after the run at which the drift begins to be removed [s of the film].
_STAYS = 0.6

# Time in which it is removed [s of the film].
_REMOVED = 1.6

# Colour of the gap between the paths.
GAP_COLOUR = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Drift:
    """How odometry alone drifts off the estimate of a run, and all that its laser has met."""

    run: Shown
    # The path of the estimate.
    believed: DriveKeys
    # The path by odometry alone.
    alone: DriveKeys
    # The scans with which the loop begins and closes that shows it best, if one does.
    loop: tuple[int, int] | None
    # The share of the drift that is left, 0…1.
    left: float = 1.0

    @classmethod
    def of(cls, run: Shown, origin: Float) -> "Drift | None":
        """The drift of a run in a frame with an origin (2,); None where it is not known."""
        estimate = run.estimate
        if estimate is None or len(estimate.odometry) < 2:
            return None
        poses = estimate.poses - [*origin, 0.0]
        odometry = estimate.odometry
        times = run.trajectory.times - run.trajectory.times.min()
        alone = compose(poses[0], between(odometry[0], odometry))
        alone[:, 2] = np.unwrap(alone[:, 2])
        loop = _loop(poses, alone, estimate.closures)
        return cls(run, DriveKeys(times, poses), DriveKeys(times, alone), loop)

    def seen(self, moment: Moment, playback: float) -> "Drift":
        """The drift at a moment of a film: after the run it is removed."""
        passed = (moment.now - moment.time) / playback
        left = 1.0 - smoothed(min(max((passed - _STAYS) / _REMOVED, 0.0), 1.0))
        poses = self.believed.poses + left * (self.alone.poses - self.believed.poses)
        return replace(self, alone=self.alone._replace(poses=poses), left=left)

    @property
    def magnified(self) -> float:
        """Width of what is magnified [m]; 0 if no loop is shown, or the drift is seen anyway."""
        off = np.hypot(*(self.alone.poses - self.believed.poses)[:, :2].T).max()
        extent = np.ptp(self.believed.poses[:, :2], axis=0).max()
        return float(_MAGNIFIED * off * (self.loop is not None and off < _SMALL * extent))

    def ends(self, time: float) -> Float:
        """Poses (2, 3) at a time of the run [s]: by odometry alone, and of the estimate."""
        passed = np.array([time - self.run.trajectory.times.min()])
        paths = self.alone, self.believed
        return np.vstack([interpolated(passed, keys.times, keys.poses) for keys in paths])

    def off(self, time: float) -> float:
        """How far odometry alone is off the estimate at a time of the run [s], [m]."""
        ghost, robot = self.ends(time)[:, :2]
        return float(np.hypot(*(ghost - robot)))

    def words(self, moment: Moment, playback: float) -> str:
        """What is said of that at a moment of a film; nothing when the drift is removed."""
        seen = self.seen(moment, playback)
        return f"gap {metres(seen.off(moment.time))}" * bool(seen.left)

    def marks(self, moment: Moment, shot: str, playback: float) -> Iterator[tuple[str, Mark]]:
        """Name and mark at a moment of a shot."""
        seen = self.seen(moment, playback)
        passed = moment.time - self.run.trajectory.times.min()
        yield "drift", trail_lines(seen.alone, passed, TRAIL_FADE * playback, GHOST_COLOUR)
        if seen.loop is not None and shot in _SHOTS:
            yield "astray", self.points(moment.mapped, seen.left)
        ghost, robot = seen.ends(moment.time)[:, None, :2]
        white = np.array([GAP_COLOUR])
        yield "gap", level_lines(2.0 * TRAIL_HEIGHT, ghost, robot, white, np.ones((1, 2)), BOLD)

    @cached_property
    def _met(self) -> tuple[Int, Float, Float]:
        """The scans (n,) of some hits, where odometry alone puts these, and where they are [m]."""
        poses = self.run.trajectory.poses
        scans = [self.run.scans_at(number)[0] for number in range(len(poses))]
        every = 1 + sum(int(scan.hits.sum()) for scan in scans) // _HITS
        hits = [scan.points()[number % every :: every] for number, scan in enumerate(scans)]
        whose = np.repeat(np.arange(len(scans)), [len(each) for each in hits])
        met = between(poses[whose], np.insert(np.concatenate(hits), 2, 0.0, axis=1))
        astray, there = (
            compose(keys.poses[whose], met)[:, :2] for keys in (self.alone, self.believed)
        )
        return whose, astray, there

    def points(self, scan: int, left: float = 1.0) -> Points:
        """What has been met up to a scan, with a share of the drift that is left."""
        whose, astray, there = self._met
        level = (there + left * (astray - there))[whose <= scan]
        colours = np.tile([*GHOST_COLOUR, _OPAQUE * left], (len(level), 1))
        spots = np.insert(level, 2, self.run.lasers[0].height, axis=1)
        sides = single(0.0 * level)
        return Points(single(spots), single(colours), sides, *_HIT_SIZE, glows=False)


@lru_cache(1)
def drift_of(run: Shown) -> Drift | None:
    """The drift of a run in the world; None where it is not known."""
    return Drift.of(run, np.zeros(2))


def _loop(poses: Float, alone: Float, closures: Int) -> tuple[int, int] | None:
    """The first of the largest loops of a path that odometry alone (k, 3) is seen to miss."""
    places = poses[:, :2]
    steps = np.hypot(*np.diff(places, axis=0).T)
    driven = np.append(0.0, np.cumsum(steps))
    swept = np.append(0.0, np.cumsum(cross(places[:-1], places[1:])))
    first, last = np.sort(closures, axis=1)[np.argsort(closures.max(axis=1), kind="stable")].T
    areas = 0.5 * np.abs(swept[last] - swept[first] + cross(places[last], places[first]))
    extents = np.sqrt(areas)
    off = np.hypot(*(alone - poses)[last, :2].T)
    seen = (off > _SEEN * extents) & (off < extents)
    long = driven[last] - driven[first]
    closed = np.hypot(*(places[last] - places[first]).T) < _OPEN * long
    areas *= seen & closed & (4.0 * np.pi * areas > _ROUND * long**2)
    if not areas.max(initial=0.0):
        return None
    best = int(np.argmax(areas >= _LARGE * areas.max()))
    return int(first[best]), int(last[best])
