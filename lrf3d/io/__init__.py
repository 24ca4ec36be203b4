"""Runs and recorded logs on disk; recording, which simulates, is loaded when it is first used."""

from typing import TYPE_CHECKING

from lrf3d.io.laser_log import BadLine, LaserLog
from lrf3d.io.reading import load_log
from lrf3d.io.run_file import load_run, save_run
from lrf3d.lazy import loading

if TYPE_CHECKING:
    from lrf3d.io.recording import record
else:
    __getattr__, __dir__ = loading(globals(), {"recording": "record"})

__all__ = ["BadLine", "LaserLog", "load_log", "load_run", "record", "save_run"]
