"""The repairs of recordings, in the order in which they are made, for maps, SLAM and localisation.

A log enters; repaired recordings leave, which keep what each repair found. Callers leave out
repairs by their names.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from lrf3d.base.errors import InputError, check_names, each_of
from lrf3d.recordings.log import LaserLog
from lrf3d.recordings.repair.angles import ANGLES
from lrf3d.recordings.repair.body import BODY
from lrf3d.recordings.repair.copies import COPIES
from lrf3d.recordings.repair.fan import FAN
from lrf3d.recordings.repair.jumps import JUMPS, STANDING
from lrf3d.recordings.repair.lag import LAG
from lrf3d.recordings.repair.mirror import MIRROR
from lrf3d.recordings.repair.mount import MOUNT
from lrf3d.recordings.repair.no_return import NO_RETURN
from lrf3d.recordings.repair.pairs import CLEARLY
from lrf3d.recordings.repair.recording import LATE, Purpose, Recording, recordings_of
from lrf3d.recordings.repair.refusal import refuse_useless
from lrf3d.recordings.repair.stamps import STAMPS
from lrf3d.recordings.repair.sweep import SWEEP

# Repairs that are made on a recording, in their order.
RECORDINGS = (COPIES, STAMPS, JUMPS, STANDING, FAN, MIRROR, LAG, MOUNT, SWEEP)

# Repairs that are made on a log, before the scans of several lasers are joined.
LOGS = (ANGLES, BODY)

# All repairs. The first is made as a log is read.
REPAIRS = (NO_RETURN, *LOGS, *RECORDINGS)

# SLAM makes all repairs.
SOLVING = Purpose()

# A map keeps the given scans and poses: the repairs named here are left out. Poses move only for a
# lag that fits at least three times better than none: with odometry once a second even a wrong lag
# can fit 1.8 times better, and blurs the map.
MAPPING = Purpose(
    ("copies", "stamps", "jumps", "standing"), sure=CLEARLY, least_lag=LATE, known=True
)

# Localisation leaves out lag and sweep: it searches in wider steps than they move a scan.
LOCALISING = Purpose(("lag", "sweep"))


def repair(log: LaserLog, purpose: Purpose, without: Sequence[str] = ()) -> list[Recording]:
    """Repair a log for a purpose; returns its one recording, or for a map one for each laser.

    ``without`` names repairs that are left out. `NO_RETURN` was made as the log was read, so that
    it is left out there: `load_log(path, without_repairs=["no_return"])`.

    Raises:
        InputError: There is no such repair, or the log is beyond repair; the message says why.

    Warns:
        Lrf3dWarning: The scans do not turn with the robot.
    """
    names = [*each_of(without, str, "without_repairs")]
    check_names("repairs", names, [each.name for each in REPAIRS])
    purpose = purpose._replace(left_out=(*purpose.left_out, *names))
    try:
        refuse_useless(log)
        for each in LOGS:
            if each.name not in names and (finding := each.find(log)):
                log = each.apply(log, finding)
        recordings = recordings_of(log, purpose)
        for each in RECORDINGS:
            recordings = [recording.repaired(each) for recording in recordings]
    except InputError as error:
        raise InputError(f"{log.path or log.name}: {error}") from None
    return recordings


def repaired_log(log: LaserLog, without: Sequence[str] = ()) -> LaserLog:
    """The log of a drive whose poses are known, repaired for a map; notes say what was wrong."""
    recordings = repair(log, MAPPING, without)
    scans = {each.scans[0].laser: iter(each.placed_scans()) for each in recordings}
    said = [text for each in recordings for text in (*each.log.notes, *each.sentences)]
    notes = (*log.notes, *(text for text in said if text not in log.notes))
    return replace(log, scans=[next(scans[scan.laser]) for scan in log.scans], notes=notes)


def figures_of(recording: Recording) -> dict[str, Any]:
    """The entries of a summary from all repairs, also from those that found nothing."""
    found = {name: each.finding for name, each in recording.found.items()}
    figures = (each.figures(found.get(each.name)).items() for each in REPAIRS)
    return dict(chain.from_iterable(figures))
