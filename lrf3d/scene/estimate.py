"""What is to be seen of a robot's estimate: its trail, its ellipses, and what the panel says.

The timeline of a run enters; the estimated trail and the 95 % ellipses leave, in the film's frame.
Some ellipses stay along the trail. All pictures draw these.
"""

from dataclasses import dataclass

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.robot import EstimatedTrajectory
from lrf3d.run import Run
from lrf3d.scene.beams import lines_at
from lrf3d.scene.look import ESTIMATE_COLOUR, ESTIMATE_FADED, TRAIL_HEIGHT
from lrf3d.scene.shapes import Lines
from lrf3d.scene.timeline import DriveKeys, Timeline
from lrf3d.scene.trail_and_map import trail_lines

MOST_KEPT = 40
"""Most ellipses that stay along the path: more would be one band."""

CORNERS = 48
"""Corners of an ellipse, as it is drawn."""

_RING_WIDTH = 1.6
"""Width of the outline of an ellipse [pixels of 720 lines]."""

TRUTH, BELIEVED = "truth", "estimate, 95 %"
"""What legends call the two trails."""


@dataclass(frozen=True, eq=False, slots=True)
class DrawnEstimate:
    """The estimate of a run as it is drawn."""

    times: Float
    """(k,) times of the scans, from the start of the run on [s]."""
    places: Float
    """(k, 2) estimated position when each scan was in [m]."""
    ellipse_times: Float
    """(m,) times when an ellipse is known [s]."""
    middles: Float
    """(m, 2) its middle [m]."""
    shapes: Float
    """(m, 2, 2) the matrix that makes it of the unit circle [m]."""
    kept: Int
    """(n,) numbers of the ellipses that stay along the path, faded."""

    @classmethod
    def from_timeline(cls, timeline: Timeline) -> "DrawnEstimate | None":
        """Take the estimate of a timeline's run; None if it has none."""
        run, estimate = timeline.run, timeline.run.estimate
        if estimate is None:
            return None
        times = run.trajectory.times - timeline.start
        places = estimate.poses[:, :2] - timeline.origin
        known, shapes = estimate.known_scans, estimate.ellipses
        return cls(times, places, times[known], places[known], shapes, kept_ellipses(estimate))

    def place(self, time: float) -> Float:
        """The estimated position (2,) at a time from the start of the run on [s]."""
        return np.array([np.interp(time, self.times, axis) for axis in self.places.T])

    def shape(self, time: float) -> Float:
        """The ellipse's matrix (2, 2) at a time, between the two that are known around it."""
        flat = self.shapes.reshape(-1, 4)
        if not len(flat):
            return np.zeros((2, 2))
        return np.reshape([np.interp(time, self.ellipse_times, part) for part in flat.T], (2, 2))

    def trail(self, time: float) -> Lines:
        """The estimated trail up to a time from the start of the run on [s]."""
        poses = np.column_stack([self.places, np.zeros(len(self.places))])
        return trail_lines(DriveKeys(self.times, poses), time, np.inf, ESTIMATE_COLOUR)

    def rings(self, time: float) -> Lines:
        """The ellipses that stay by a time, faded, and the one that is known now."""
        kept = int(np.searchsorted(self.ellipse_times[self.kept], time, side="right"))
        now = outlines(self.place(time)[None], self.shape(time)[None])
        rings = np.concatenate([self.outlines()[:kept], now])
        alpha = np.full(len(rings) * CORNERS, ESTIMATE_FADED)
        alpha[-CORNERS:] = 1.0
        following = np.roll(rings, -1, axis=1)
        colours = np.tile(ESTIMATE_COLOUR, (len(alpha), 1))
        ends = rings.reshape(-1, 2), following.reshape(-1, 2)
        return lines_at(TRAIL_HEIGHT, *ends, colours, alpha[:, None] * [1.0, 1.0], _RING_WIDTH)

    def outlines(self) -> Float:
        """Outlines (n, CORNERS, 2) of the ellipses that stay [m]."""
        return outlines(self.middles[self.kept], self.shapes[self.kept])


def outlines(middles: Float, shapes: Float) -> Float:
    """Outlines (n, CORNERS, 2) of ellipses with middles (n, 2) and matrices (n, 2, 2) [m]."""
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(middles[:, None] + np.einsum("nij,cj->nci", shapes, circle))


def ring_quads(rings: Float, width: float) -> Float:
    """Quads (n · c, 4, 2) of ribbons of a width along closed outlines (n, c, 2) [m].

    Both sides lie on the rays from the middle, on which an outline's corners lie.
    """
    away = rings - rings.mean(axis=1, keepdims=True)
    far = np.maximum(np.hypot(away[..., 0], away[..., 1]), 1e-9)[..., None]
    side = 0.5 * width * away / far
    inner, outer = rings - side, rings + side
    corners = [inner, outer, np.roll(outer, -1, axis=1), np.roll(inner, -1, axis=1)]
    return np.stack(corners, axis=2).reshape(-1, 4, 2)


def kept_ellipses(estimate: EstimatedTrajectory) -> Int:
    """Which ellipses (n,) stay along the path: at most this number, and none that overlap."""
    known, shapes = estimate.known_scans, estimate.ellipses
    steps = np.diff(estimate.poses[:, :2], axis=0)
    ways = np.concatenate([[0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
    sizes = np.sqrt(np.einsum("nij,nij->n", shapes, shapes))
    kept: list[int] = []
    for number, (scan, size) in enumerate(zip(known.tolist(), sizes.tolist(), strict=True)):
        if size <= 0.0:
            # The start is certain: a point, and no ellipse.
            continue
        gap = max(float(ways[-1]) / MOST_KEPT, size)
        if not kept or ways[scan] - ways[known[kept[-1]]] >= gap:
            kept.append(number)
    return np.array(kept, dtype=np.int64)


def estimate_words(run: Run, scan: int) -> tuple[tuple[str, str], ...]:
    """What the panel says of a run's estimate after a scan: for each trail its name and its error.

    Nothing where the robot was given its poses.
    """
    estimate = run.estimate
    if estimate is None:
        return ()
    if not run.knows_truth:
        return ((BELIEVED, ""),)
    apart = float(np.hypot(*(estimate.poses[scan, :2] - run.trajectory.poses[scan, :2])))
    return ((TRUTH, ""), (BELIEVED, f"{apart:.2f} m off"))
