"""Stopping what reports its progress, as a user or a full disk might."""


class Stop(Exception):
    """Raised to stop a run."""


def stopping(at):
    """What is called with how much is done, and stops there."""

    def progress(done, total):
        if done == at:
            raise Stop

    return progress
