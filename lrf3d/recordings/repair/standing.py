"""Standing: odometry that never moves is treated as missing."""

from dataclasses import replace

from lrf3d.recordings.repair import Repair

STANDING = Repair(
    "standing",
    lambda recording: recording.path.stands or None,
    lambda recording, _: replace(recording, log=replace(recording.log, placed=False)),
)
