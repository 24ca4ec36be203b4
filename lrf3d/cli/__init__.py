"""The command line: one typed function a command, heavy imports inside."""

from lrf3d.cli.app import main

__all__ = ["main"]
