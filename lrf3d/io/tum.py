"""TUM trajectories: one pose a line, as evo and other tools for trajectories read them.

A line is ``t x y z qx qy qz qw``: time [s], position [m] and orientation as a unit quaternion.
"""

from pathlib import Path

import numpy as np

from lrf3d.geometry import Float
from lrf3d.output import write_text


def save_tum(times: Float, poses: Float, path: str | Path) -> None:
    """Write poses (k, 3) x, y [m], theta [rad] at times (k,) [s] to a file, whole or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    sines, cosines = np.sin(0.5 * poses[:, 2]), np.cos(0.5 * poses[:, 2])
    rows = zip(times.tolist(), poses.tolist(), sines.tolist(), cosines.tolist(), strict=True)
    lines = [
        f"{time:.6f} {x:.6f} {y:.6f} 0 0 0 {sine:.9f} {cosine:.9f}\n"
        for time, (x, y, _), sine, cosine in rows
    ]
    write_text(Path(path), "".join(lines))
