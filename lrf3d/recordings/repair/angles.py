"""Angles: those of a laser's beams differ by rounding from scan to scan, as drivers write them."""

from dataclasses import replace

import numpy as np

from lrf3d.laser import LaserScan
from lrf3d.recordings.log import FINEST, LaserLog
from lrf3d.recordings.repair import Repair


def find(log: LaserLog) -> list[LaserScan] | None:
    """The scans of a log with the angles of the first one where they hardly differ from these."""
    first = log.scans[0].angles
    scans = [
        replace(scan, angles=first)
        if scan.angles is not first
        and scan.angles.shape == first.shape
        and np.abs(scan.angles - first).max() <= FINEST
        else scan
        for scan in log.scans
    ]
    return scans if any(a is not b for a, b in zip(scans, log.scans, strict=True)) else None


ANGLES = Repair("angles", find, lambda log, scans: replace(log, scans=scans))
