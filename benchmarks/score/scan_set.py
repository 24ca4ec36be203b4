"""ScanSet: single scans from a file, to compare line extraction at an equal number of vertices.

The file is an .npz as made from the scans of Schaefer et al. (IROS 2018), one prefix for each kind
of scans: ``KIND_pose`` (s, 3), ``KIND_n`` (s,) beams of each scan, ``KIND_azimuth`` [rad] and
``KIND_range`` [m] of all beams in a row, ``KIND_rlim`` (s, 2) the valid ranges; and where the
truth is known, the corners of a polygon around each scan: ``KIND_poly_n``, ``KIND_poly_xy``.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lrf3d.errors import InputError
from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.pose import as_pose


@dataclass(frozen=True, eq=False)
class ScanSet:
    """Scans of one kind.

    Args:
        kind: What they are called in the file.
        scans: The scans.
        polygons: (k, 2) the true polygon around each scan; none where it is not known.
    """

    kind: str
    scans: list[LaserScan]
    polygons: list[Float]


def load_scan_sets(path: Path) -> list[ScanSet]:
    """Read all kinds of scans of a file.

    Raises:
        InputError: The file cannot be read, or does not hold such scans.
    """
    try:
        with np.load(path) as file:
            columns = {name: file[name] for name in file.files}
        kinds = [name.removesuffix("_azimuth") for name in columns if name.endswith("_azimuth")]
        sets = [_scan_set(kind, columns) for kind in kinds]
    except (OSError, KeyError, ValueError, EOFError) as error:
        raise InputError(f"{path}: cannot be read as single scans ({error})") from None
    if not sets:
        raise InputError(f"{path}: holds no scans; expected arrays such as real_azimuth")
    return sets


def _scan_set(kind: str, columns: dict[str, Any]) -> ScanSet:
    starts = np.cumsum(columns[f"{kind}_n"])[:-1]
    azimuths = np.split(columns[f"{kind}_azimuth"], starts)
    ranges = np.split(columns[f"{kind}_range"].astype(np.float64), starts)
    scans = []
    for pose, (low, high), angles, measured in zip(
        columns[f"{kind}_pose"], columns[f"{kind}_rlim"], azimuths, ranges, strict=True
    ):
        valid = np.where((measured <= low) | (measured >= high), np.inf, measured)
        scans.append(LaserScan(as_pose(pose), angles, valid, range_max=float(high)))
    polygons = []
    if f"{kind}_poly_n" in columns:
        corners = np.cumsum(columns[f"{kind}_poly_n"])[:-1]
        polygons = np.split(columns[f"{kind}_poly_xy"], corners)
    return ScanSet(kind, scans, polygons)
