"""Timeline: where the robot stands and which scan is seen at each time of a film."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from lrf3d.geometry import Bool, Float
from lrf3d.run import Run
from lrf3d.scene.structures import Sight

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


DWELL_GAP = 1.0
"""Scans farther apart in time than this [s] are stops and not a drive."""

DWELL_SHARE = 0.75
"""Share of the time between two stops that the robot stands and scans."""

_SET_DOWN = 5e-4
"""Half the time [s] in which a robot is set down behind a wall."""

_SPEED_STEP = 0.05
"""Half the time [s] over which the speed is measured: shorter shows the joints of the path."""


@dataclass(frozen=True, slots=True)
class Moment:
    """What is to be seen at one time of a run.

    Args:
        time: Time of the run [s].
        pose: (3,) pose of the robot x, y [m], theta [rad] in the world.
        scan: Index of the newest scan.
        speed: Speed of the robot [m/s].
        scanning: Whether the beams are on.
    """

    time: float
    pose: Float
    scan: int
    speed: float
    scanning: bool


class Timeline:
    """The run as a function of time.

    A run of single stops, such as the paper's three poses, is played as stops: the robot stands
    with the beams on, then glides to the next pose with the beams off, or is set down there where
    a wall stands between.

    Args:
        run: The run.
        playback: Seconds of the run in a second of the film; the run's own if not given.

    Attributes:
        origin: (2,) where the origin of the film's frame lies in the world [m].
    """

    def __init__(self, run: Run, *, playback: float | None = None) -> None:
        self.run = run
        self.playback = run.film.playback if playback is None else playback
        self.origin = Sight.of_run(run).origin
        times = run.trajectory.times
        gaps = np.diff(times)
        self.dwells = len(gaps) == 0 or float(np.median(gaps)) > DWELL_GAP
        self.set_down = self._legs_through_walls() if self.dwells else np.zeros(len(gaps), np.bool_)
        self.start = float(times[0])
        self.end = float(times[-1])
        if self.dwells:
            # The last stop is looked at as long as the others.
            self.end += DWELL_SHARE * (float(np.median(gaps)) if len(gaps) else DWELL_GAP)

    def frame_times(self, fps: float, margins: tuple[float, float] = (0.0, 0.0)) -> Float:
        """Times (frames,) of the run [s] that a film shows, first to last, at least one.

        Args:
            fps: Frames a second.
            margins: How long the film goes on before and after the run [s of the film]; there the
                run stands still, and only the camera moves.
        """
        step = self.playback / fps
        first = -int(np.floor(margins[0] * fps))
        length = (self.end - self.start) / step + margins[1] * fps
        frames = np.arange(first, int(np.floor(length + 1e-6)) + 1, dtype=np.float64)
        return self.start + step * frames

    def poses(self, times: Float) -> Float:
        """Poses (m, 3) of the robot at times (m,) [s]."""
        return self.run.trajectory.at(self._driven(np.asarray(times, dtype=np.float64)))

    def moment(self, time: float) -> Moment:
        """What is to be seen at a time [s]; before the start it is the start, and so at the end."""
        times = self.run.trajectory.times
        time = min(max(time, self.start), self.end)
        scan = int(
            np.clip(np.searchsorted(times, time + 1e-9, side="right") - 1, 0, len(times) - 1)
        )
        around = self.poses(np.array([time - _SPEED_STEP, time, time + _SPEED_STEP]))
        step = 0.0 if self.dwells else float(np.hypot(*(around[2, :2] - around[0, :2])))
        speed = step / (2.0 * _SPEED_STEP)
        scanning = True
        if self.dwells and scan + 1 < len(times):
            gap = times[scan + 1] - times[scan]
            scanning = bool(time - times[scan] <= DWELL_SHARE * gap)
        return Moment(float(time), around[1], scan, speed, scanning)

    def _driven(self, times: Float) -> Float:
        """The times of the trajectory that are shown at the times of the film."""
        knots = self.run.trajectory.times
        if not self.dwells or len(knots) < 2:
            return times
        stop = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
        gap = knots[stop + 1] - knots[stop]
        share = np.clip((times - knots[stop]) / gap, 0.0, 1.0)
        glide = np.clip((share - DWELL_SHARE) / (1.0 - DWELL_SHARE), 0.0, 1.0)
        # The glide starts and ends at rest, as a robot does.
        eased = np.where(self.set_down[stop], glide > 0.5, glide * glide * (3.0 - 2.0 * glide))
        return np.asarray(knots[stop] + gap * eased)

    def _legs_through_walls(self) -> Bool:
        """Which legs (k − 1,) between stops cross a wall."""
        places = self.run.trajectory.poses[:, :2]
        legs = shapely.linestrings(np.stack([places[:-1], places[1:]], axis=1))
        walls = shapely.STRtree(shapely.linestrings(self.run.world.segments.reshape(-1, 2, 2)))
        crosses = np.zeros(len(legs), np.bool_)
        crosses[walls.query(legs, predicate="intersects")[0]] = True
        return crosses


_GLIDE_KEYS = 12
"""Keys between two stops of a robot that stands and scans: enough for a soft start and end."""


class DriveKeys(NamedTuple):
    """The robot's way in key poses, between which it goes straight and evenly."""

    times: Float
    """(k,) when it is there, from the start of the run on [s], rising."""
    poses: Float
    """(k, 3) its poses in the film's frame; headings go on past half a turn."""


def drive_keys(timeline: Timeline) -> DriveKeys:
    """The key poses of a run's robot, as it is seen to move."""
    times = timeline.run.trajectory.times
    if timeline.dwells and len(times) > 1:
        glide = DWELL_SHARE + (1.0 - DWELL_SHARE) * np.linspace(0.0, 1.0, _GLIDE_KEYS + 1)
        keys = times[:-1, None] + np.diff(times)[:, None] * glide
        turns = times[:-1] + 0.5 * (1.0 + DWELL_SHARE) * np.diff(times)
        turns = turns[timeline.set_down]
        times = np.concatenate([times, keys.ravel(), turns - _SET_DOWN, turns + _SET_DOWN])
    times = np.unique(np.append(times, timeline.end))
    poses = timeline.poses(times) - [*timeline.origin, 0.0]
    poses[:, 2] = np.unwrap(poses[:, 2])
    return DriveKeys(times - timeline.start, poses)


def obstacle_keys(obstacle: "DynamicObstacle", timeline: Timeline) -> tuple[Float, Float]:
    """Times (k,) between which an obstacle goes straight, and its poses (k, 3) in the film's frame.

    Times count from the start of the run [s].
    """
    times = obstacle.poses.times
    within = times[(times > timeline.start) & (times < timeline.end)]
    keys = np.unique([timeline.start, *within, timeline.end])
    poses = obstacle.path.at(keys) - [*timeline.origin, 0.0]
    poses[:, 2] = np.unwrap(poses[:, 2])
    return keys - timeline.start, poses


def scan_times(timeline: Timeline, every: int = 1) -> tuple[Float, Float]:
    """When each scan begins and ends to be visible [s].

    A scan is seen half before and half after its moment: then the robot is never far from where
    it scanned. At a stop it is seen until the robot leaves.
    """
    times = timeline.run.trajectory.times[::every]
    if not timeline.dwells:
        middles = 0.5 * (times[:-1] + times[1:])
        return np.append(timeline.start, middles), np.append(middles, timeline.end)
    ends = times + DWELL_SHARE * np.diff(times, append=timeline.end)
    ends[-1] = timeline.end
    return times, ends
