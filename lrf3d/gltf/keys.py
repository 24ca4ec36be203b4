"""When things of a run are keyed for players that go straight from key to key."""

from typing import TYPE_CHECKING

import numpy as np

from lrf3d.geometry import Bool, Float
from lrf3d.render.timeline import DWELL_SHARE, Timeline

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover

_GLIDE_KEYS = 12
"""Keys between two stops of a robot that stands and scans: enough for a soft start and end."""

_SET_DOWN = 1e-3
"""Half the time [s] in which a robot is set down behind a wall."""


def key_times(timeline: Timeline) -> Float:
    """Times [s] of the run between which the robot's way is straight enough, rising."""
    times = timeline.run.trajectory.times
    if not timeline.dwells or len(times) < 2:
        return np.append(times, timeline.end) if timeline.end > times[-1] else times
    glide = DWELL_SHARE + (1.0 - DWELL_SHARE) * np.linspace(0.0, 1.0, _GLIDE_KEYS + 1)
    gaps = np.diff(times)
    keys = times[:-1, None] + gaps[:, None] * glide
    # Where the robot is set down behind a wall, it is here or there, but never on the way.
    turn = times[:-1] + gaps * (DWELL_SHARE + 0.5 * (1.0 - DWELL_SHARE))
    turn = turn[timeline.jumps]
    keys = np.concatenate([times, keys.ravel(), turn - _SET_DOWN, turn + _SET_DOWN])
    return np.unique(np.append(keys, timeline.end))


def mover_keys(mover: "Mover", timeline: Timeline) -> tuple[Float, Float]:
    """Times (k,) [s] of a run between which an obstacle goes straight, and its poses (k, 3)."""
    times = mover.path.times
    within = times[(times > timeline.start) & (times < timeline.end)]
    keys = np.unique([timeline.start, *within, timeline.end])
    poses = mover.path.at(keys)
    poses[:, 2] = np.unwrap(poses[:, 2])
    return keys, poses


def jumps(times: Float) -> Bool:
    """Which legs (k − 1,) between key times (k,) were not driven: the robot was set down."""
    return np.asarray(np.diff(times) <= 2.5 * _SET_DOWN)


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
