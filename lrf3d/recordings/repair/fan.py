"""Fan: if a log does not give the bearings of beams, find those whose turns match the odometry."""

from dataclasses import replace
from math import degrees

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.base.interrupts import check
from lrf3d.geometry.lines import sealed
from lrf3d.recordings.repair import Repair
from lrf3d.recordings.repair.pairs import CLEARLY
from lrf3d.recordings.repair.recording import Recording

# Largest relative error of the turns of scans with the right fan, compared with odometry.
FITTING = 0.1


def find(recording: Recording) -> Recording | None:
    """The recording with the alternative fan that fits clearly better; None if none does."""
    own = _off(recording)
    wide = float(np.ptp(recording.scans[0].angles))
    tried = [
        _over(recording, first, last)
        for first, last in recording.log.fans
        # A fan of another width scales the turns: it is not tried where it must fit worse.
        if not own < 0.5 * abs(1.0 - wide / (last - first))
    ]
    best = min(tried, key=_off, default=recording)
    if own / CLEARLY <= _off(best):
        return None
    if _off(best) > FITTING:
        raise InputError(
            "the scans turn unlike the odometry, whichever usual fan their beams may have; name"
            " it by --format, such as 'first=-120deg, last=120deg'"
        )
    return replace(best, seen_turns=best.turns)


def _off(recording: Recording) -> float:
    """Relative error of the turns of the scans, compared with those of the robot."""
    return abs(recording.shown_share() - 1.0)


def _over(recording: Recording, first: float, last: float) -> Recording:
    """The recording with beams spread from the first bearing to the last."""
    check()
    counts = {len(scan.angles) for scan in recording.scans}
    fans = {beams: sealed(np.linspace(first, last, beams)) for beams in counts}
    scans = [replace(scan, angles=fans[len(scan.angles)]) for scan in recording.scans]
    return replace(recording, scans=scans, seen_turns=None)


def sentence(spread: Recording) -> str:
    """Which fan is assumed."""
    first, last = (degrees(angle) for angle in spread.scans[0].angles[[0, -1]])
    return f"beams from {first:.4g}° to {last:.4g}°, as the scans turn"


FAN = Repair("fan", find, lambda _, spread: spread, sentence)
