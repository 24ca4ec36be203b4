"""The command line: one typed function a command, heavy imports inside."""

from lrf3d.cli.program import main

__all__ = ["main"]
