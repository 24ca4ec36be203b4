"""Runs whose robots were not given their poses."""

from dataclasses import replace

import numpy as np

from lrf3d.robot import EstimatedTrajectory


def estimated(run, shift=(0.3, 0.4, 0.0)):
    """The run with an estimate beside its truth by a shift, which knows its place ever less well.

    Ellipses are known at every other scan, longer along x than along y; one loop is closed, one is
    dropped.
    """
    count = len(run)
    known = np.arange(0, count, 2)
    spread = 0.4 * known / max(known[-1], 1)
    covariances = np.zeros((len(known), 3, 3))
    for axis, share in enumerate((1.0, 0.5, 0.1)):
        covariances[:, axis, axis] = (share * spread) ** 2
    estimate = EstimatedTrajectory(
        run.trajectory.poses + np.array(shift), known, covariances, [[0, count - 1]], [[1, 2]]
    )
    return replace(run, estimate=estimate)
