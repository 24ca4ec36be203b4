"""Runs and recorded logs on disk; modules that simulate or map are loaded on first use."""

from typing import TYPE_CHECKING

from lrf3d.base.lazy import loading
from lrf3d.recordings.log import BadLine, LaserLog
from lrf3d.recordings.reading import load_log

if TYPE_CHECKING:
    from lrf3d.recordings.formats.recording import record
    from lrf3d.recordings.formats.run_file import load_run, save_run
else:
    homes = {"formats.recording": "record", "formats.run_file": "load_run save_run"}
    __getattr__, __dir__ = loading(globals(), homes)

__all__ = ["BadLine", "LaserLog", "load_log", "load_run", "record", "save_run"]
