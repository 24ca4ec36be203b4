"""Standing: odometry that never moves counts as missing."""

from dataclasses import replace

from lrf3d.recordings.repair.recording import Recording
from lrf3d.recordings.repair.repair import Repair


def find(recording: Recording) -> bool | None:
    """Whether the odometry of a log never moves."""
    return recording.path.stands or None


def apply(recording: Recording, _: bool) -> Recording:
    """The recording without odometry."""
    return replace(recording, log=replace(recording.log, placed=False))


STANDING = Repair("standing", find, apply)
