"""Runs on disk."""

from lrf3d.logs.run_file import load_run, save_run

__all__ = ["load_run", "save_run"]
