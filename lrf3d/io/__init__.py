"""Runs and recorded logs on disk."""

from lrf3d.io.laser_log import BadLine, LaserLog
from lrf3d.io.reading import load_log
from lrf3d.io.recording import record
from lrf3d.io.run_file import load_run, save_run

__all__ = ["BadLine", "LaserLog", "load_log", "load_run", "record", "save_run"]
