"""The robot's trails on the ground: where it drove, and where it believed that it was.

The keys of a drive and the estimate of a run enter; leave lines in the film's frame: trails, and
the 95 % ellipses of the estimate, some of which stay along its trail.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.scene.look import ESTIMATE_COLOUR, ESTIMATE_FADED, TRAIL_COLOUR, TRAIL_HEIGHT
from lrf3d.scene.shapes import Lines, level_lines
from lrf3d.scene.timeline import DriveKeys, Timeline, interpolated

_WIDTH, _RING_WIDTH, _FRESH, _OLD = 3.4, 1.6, 0.95, 0.35
"""Widths of trails and of the outlines of ellipses [pixels of 720 lines], and the opacity of the
trail where the robot is, and long after."""

MOST_KEPT, CORNERS = 40, 48
"""Most ellipses that stay along the path, as more would be one band; and corners of one as drawn.
"""

TRUTH = "truth"
"""What legends call the trail of where the robot was."""


def believed(estimate: EstimatedTrajectory) -> str:
    """What legends call the trail of an estimate, which may have no ellipses."""
    return "estimate, 95 %" if len(estimate.known_scans) else "estimate"


def trail_lines(
    keys: DriveKeys, now: float, fade: float, colour: tuple[float, float, float] = TRAIL_COLOUR
) -> Lines:
    """The trail up to a time [s]; what is older is paler, after a time of fading [s]."""
    begun = min(len(keys.times) - 1, int(np.searchsorted(keys.times, now)))
    places, times = keys.poses[: begun + 1, :2].copy(), keys.times[: begun + 1]
    places[begun:] = interpolated(np.array([now]), keys.times, keys.poses[:, :2])
    old = np.clip((now - times) / fade, 0.0, 1.0)
    left = _FRESH + (_OLD - _FRESH) * old * (2.0 - old)
    legs = np.flatnonzero(keys.driven[:begun])
    opacities = np.column_stack([left[legs], left[legs + 1]])
    colours = np.tile(colour, (len(legs), 1))
    return level_lines(TRAIL_HEIGHT, places[legs], places[legs + 1], colours, opacities, _WIDTH)


@dataclass(frozen=True, eq=False, slots=True)
class DrawnEstimate:
    """The estimate of a run as it is drawn."""

    keys: DriveKeys
    """Where the robot believed that it was at each of its scans."""
    known: Int
    """(m,) the scans with which an ellipse is known."""
    shapes: Float
    """(m, 2, 2) the matrices that make the ellipses of the unit circle [m]."""
    kept: Int
    """(n,) numbers of the ellipses that stay along the path, faded."""

    @classmethod
    def from_timeline(cls, timeline: Timeline) -> "DrawnEstimate | None":
        """Take the estimate of a timeline's run; None if it has none."""
        estimate = timeline.run.estimate
        if estimate is None:
            return None
        times = timeline.run.trajectory.times - timeline.start
        keys = DriveKeys(times, estimate.poses - [*timeline.origin, 0.0])
        return cls(keys, estimate.known_scans, estimate.ellipses, kept_ellipses(estimate))

    def trail(self, time: float, fade: float) -> Lines:
        """The estimated trail up to a time from the start of the run on, paler with age [s]."""
        return trail_lines(self.keys, time, fade, ESTIMATE_COLOUR)

    def rings(self, time: float) -> Lines:
        """The ellipses that stay by a time, faded, and the one that is known now."""
        times, now = self.keys.times[self.known], np.array([time])
        rings = self.outlines()[times[self.kept] <= time]
        alpha = np.full((len(rings) * CORNERS, 2), ESTIMATE_FADED)
        if len(times):
            place = interpolated(now, self.keys.times, self.keys.poses[:, :2])
            shape = interpolated(now, times, self.shapes.reshape(-1, 4)).reshape(1, 2, 2)
            rings = np.concatenate([rings, outlines(place, shape)])
            alpha = np.concatenate([alpha, np.ones((CORNERS, 2))])
        starts, ends = rings.reshape(-1, 2), np.roll(rings, -1, axis=1).reshape(-1, 2)
        colours = np.tile(ESTIMATE_COLOUR, (len(alpha), 1))
        return level_lines(TRAIL_HEIGHT, starts, ends, colours, alpha, _RING_WIDTH)

    def outlines(self) -> Float:
        """Outlines (n, CORNERS, 2) of the ellipses that stay [m]."""
        return outlines(self.keys.poses[self.known[self.kept], :2], self.shapes[self.kept])


def outlines(middles: Float, shapes: Float) -> Float:
    """Outlines (n, CORNERS, 2) of ellipses with middles (n, 2) and matrices (n, 2, 2) [m]."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(middles[:, None] + np.einsum("nij,cj->nci", shapes, circle))


def kept_ellipses(estimate: EstimatedTrajectory) -> Int:
    """Which ellipses (n,) stay along the path: at most this number, and none that overlap."""
    steps = np.hypot(*np.diff(estimate.poses[:, :2], axis=0).T)
    driven = np.append(0.0, np.cumsum(steps))
    sizes = np.linalg.norm(estimate.ellipses, axis=(1, 2)).tolist()
    kept, last = list[int](), -np.inf
    for number, (place, size) in enumerate(zip(driven[estimate.known_scans], sizes, strict=True)):
        # The start is certain: a point, and no ellipse.
        if size > 0.0 and place - last >= max(steps.sum() / MOST_KEPT, size):
            kept.append(number)
            last = place
    return np.array(kept, dtype=np.int64)


def estimate_words(run: Run, scan: int) -> tuple[tuple[str, str], ...]:
    """What the panel says of a run's estimate after a scan: for each trail its name and its error.

    Nothing where the robot was given its poses.
    """
    estimate = run.estimate
    if estimate is None:
        return ()
    if not run.knows_truth:
        return ((believed(estimate), ""),)
    apart = float(np.hypot(*(estimate.poses[scan, :2] - run.trajectory.poses[scan, :2])))
    return ((TRUTH, ""), (believed(estimate), f"{apart:.2f} m off"))
