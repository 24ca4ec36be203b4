"""The command line: one typed function for each command, with heavy imports inside."""

from lrf3d.apps.cli.program import main

__all__ = ["main"]
