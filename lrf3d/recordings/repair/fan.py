"""Fan: the bearings of beams that a log does not give are those that turn as the odometry does."""

from dataclasses import replace
from math import degrees
from typing import NamedTuple

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import sealed
from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.repair import Repair
from lrf3d.recordings.repair.turns import CLEARLY

# Share of the robot's turns by which those of scans over the right fan may be off.
FITTING = 0.1


class Fan(NamedTuple):
    """First and last bearing [rad], the recording with them, and by what share it turns wrongly."""

    first: float
    last: float
    recording: Recording
    off: float


def find(recording: Recording) -> Fan | None:
    """The fan that fits clearly better than that of the scans, of those that the log may mean."""
    own = abs(recording.shown_share() - 1.0)
    wide = float(np.ptp(recording.scans[0].angles))
    tried = [
        _over(recording, first, last)
        for first, last in recording.log.fans
        # Else its turns would differ from those of the odometry by more than those of the scans.
        if not own < 0.5 * abs(1.0 - wide / (last - first))
    ]
    best = min(tried, key=lambda fan: fan.off, default=None)
    if best is None or own / CLEARLY <= best.off:
        return None
    if best.off > FITTING:
        raise InputError(
            "the scans turn unlike the odometry, whichever usual fan their beams may have; name"
            " it, such as --format '-, ranges*682, x, y, theta, first=-120deg, last=120deg'"
        )
    return best


def _over(recording: Recording, first: float, last: float) -> Fan:
    """The recording with beams spread from the first bearing to the last."""
    check()
    fans = {
        beams: sealed(np.linspace(first, last, beams))
        for beams in {len(scan.angles) for scan in recording.scans}
    }
    scans = [replace(scan, angles=fans[len(scan.angles)]) for scan in recording.scans]
    spread = replace(recording, scans=scans, seen_turns=None)
    return Fan(first, last, spread, abs(spread.shown_share() - 1.0))


def apply(recording: Recording, fan: Fan) -> Recording:
    """The recording with this fan, which is an assumption: the log notes it."""
    notes = (*recording.log.notes, sentence(fan))
    log = replace(recording.log, notes=notes)
    return replace(fan.recording, log=log, seen_turns=fan.recording.turns)


def sentence(fan: Fan) -> str:
    """Which fan is assumed."""
    first, last = degrees(fan.first), degrees(fan.last)
    return f"beams from {first:.4g}° to {last:.4g}°, as the scans turn"


FAN = Repair("fan", find, apply, sentence)
