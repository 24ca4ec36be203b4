"""Whether the scans of a log turn as its poses do: fans that are not given, mirrored lasers.

Scans and the path of their robot enter; the scans that agree with the path leave.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from math import degrees
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError, Lrf3dWarning
from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import Float, Int, sealed
from lrf3d.laser import LaserScan
from lrf3d.matching.key_scans import ScanConverter
from lrf3d.recordings import LaserLog
from lrf3d.recordings.repair.odometry import (
    CLEARLY,
    LEAST_PAIRS,
    LEAST_TURN,
    WheelPath,
    is_mirrored,
    turns_between,
)


class Agreeing(NamedTuple):
    """Scans (k,) that turn as the path does, their turns, whether they were mirrored, and notes."""

    scans: list[LaserScan]
    turns: Float
    mirrored: bool
    notes: list[str]


def agreeing(
    log: LaserLog, scans: list[LaserScan], converter: ScanConverter, path: WheelPath, places: Int
) -> Agreeing:
    """The scans (k,) of a log, at places of a path, as they agree with it.

    Fans that the log does not give are found. Scans that do not turn with the robot are warned of.
    """
    steps = np.abs(np.diff(path.at(places), axis=0))
    wheels = steps[:, 2]

    def share(turns: Float, least: Float | float = LEAST_TURN) -> float:
        """How much of the turns of the robot the scans show; infinite where that is not known."""
        known = np.isfinite(turns) & (wheels > LEAST_TURN) & (wheels > least)
        if known.sum() < LEAST_PAIRS:
            return np.inf
        return float(np.median(np.abs(turns[known]) / wheels[known]))

    try:
        scans, turns, notes = _with_fan(log, scans, converter, path, places, share)
        mirrored = is_mirrored(turns, path, places)
    except InputError as error:
        raise InputError(f"{log.name}: {error}") from None
    # Least share of the turns of a robot that show in scans of a level plane; turn per metre
    # [rad/m] from which on it is no error of the wheels, and the whole turn [rad] that shows it.
    least_shown = 0.1
    bent = 0.1
    whole = np.pi
    clear = bent * np.hypot(*steps[:, :2].T)
    if wheels[wheels > clear].sum() > whole and share(turns, clear) < least_shown:
        warnings.warn(
            f"{log.name}: its scans do not turn with the robot: the laser does not scan a level"
            " plane, or the poses are not those of its robot",
            Lrf3dWarning, stacklevel=3,
        )  # fmt: skip
    if not mirrored:
        return Agreeing(scans, turns, mirrored, notes)
    # The order of the beams in time is lost with that of their angles.
    angles_of = {id(scan.angles): sealed(-scan.angles[::-1]) for scan in scans}
    scans = [
        replace(scan, angles=angles_of[id(scan.angles)], ranges=scan.ranges[::-1],
                time_increment=0.0)
        for scan in scans
    ]  # fmt: skip
    return Agreeing(scans, -turns, mirrored, notes)


def _with_fan(
    log: LaserLog,
    scans: list[LaserScan],
    converter: ScanConverter,
    path: WheelPath,
    places: Int,
    share: Callable[[Float], float],
) -> tuple[list[LaserScan], Float, list[str]]:
    """Scans with their fan, unless one that the log may mean fits clearly better; turns, notes."""
    turns = turns_between(converter, scans, path, places)
    fitting = 0.1  # Share of turns by which those of scans over the right fan may be off.
    own = abs(share(turns) - 1.0)
    wide = float(np.ptp(scans[0].angles))
    found = [(own / CLEARLY, scans, turns, list[str]())]
    for first, last in log.fans:
        # Its turns would differ from those of the odometry by more than that.
        if own < 0.5 * abs(1.0 - wide / (last - first)):
            continue
        check()
        angles = sealed(np.linspace(first, last, len(scans[0].angles)))
        note = f"beams from {degrees(first):.4g}° to {degrees(last):.4g}°, as the scans turn"
        other = [
            replace(scan, angles=angles if len(angles) == len(scan.angles)
                    else np.linspace(first, last, len(scan.angles)))
            for scan in scans
        ]  # fmt: skip
        turns = turns_between(converter, other, path, places)
        found.append((abs(share(turns) - 1.0), other, turns, [note]))
    least, scans, turns, notes = min(found, key=lambda fan: fan[0])
    if notes and least > fitting:
        raise InputError(
            "the scans turn unlike the odometry, whichever usual fan their beams may have; name"
            " it, such as --format '-, ranges*682, x, y, theta, first=-120deg, last=120deg'"
        )
    return scans, turns, notes
