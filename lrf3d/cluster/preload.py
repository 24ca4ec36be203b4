"""What each process of a local cluster loads first: Ctrl-C is for the one that talks to the user.

A terminal sends it to all; without this every worker would end with a traceback of its own.
"""

import signal
from typing import Any


def dask_setup(worker: Any) -> None:
    """Called by Dask in each new worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
