"""Stopping what reports its progress, as a user or a full disk might."""

import pytest

import lrf3d


class Stop(Exception):
    """Raised to stop a run."""


def stopping(at):
    """What is called with how much is done, and stops there."""

    def progress(done, total):
        if done == at:
            raise Stop

    return progress


def record_up_to(at, simulation, path, **options):
    """Record a run that is stopped after a number of scans."""
    with pytest.raises(Stop):
        lrf3d.record(simulation, path, progress=stopping(at), **options)
