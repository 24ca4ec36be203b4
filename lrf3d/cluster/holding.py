"""Holding: data that many tasks need, sent to a cluster once."""

import warnings
from collections.abc import Callable
from typing import Any


def hold(client: Any, make: Callable[[bytes], Any], packed: bytes, *, key: str) -> Any:
    """What is made of packed data, on the cluster, as an argument for tasks.

    It is the result of a task and no data that was handed around: when the last worker that held
    it has died, it is made again.

    Args:
        client: The client of the cluster.
        make: Makes it of the packed data, on a worker.
        packed: The data, which the scheduler keeps.
        key: Its name on the cluster.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
        return client.submit(make, packed, key=key)
