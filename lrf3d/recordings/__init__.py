"""Runs and recorded logs on disk; recording, which simulates, is loaded when it is first used."""

from typing import TYPE_CHECKING

from lrf3d.base.lazy import loading
from lrf3d.recordings.formats.run_file import load_run, save_run
from lrf3d.recordings.log import BadLine, LaserLog
from lrf3d.recordings.reading import load_log

if TYPE_CHECKING:
    from lrf3d.recordings.formats.recording import record
else:
    __getattr__, __dir__ = loading(globals(), {"formats.recording": "record"})

__all__ = ["BadLine", "LaserLog", "load_log", "load_run", "record", "save_run"]
