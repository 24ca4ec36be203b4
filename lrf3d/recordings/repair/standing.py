"""Standing: odometry that never moves counts as missing."""

from dataclasses import replace

from lrf3d.recordings.repair import Repair

STANDING = Repair(
    "standing",
    lambda recording: recording.path.stands or None,
    lambda recording, _: replace(recording, log=replace(recording.log, placed=False)),
)
