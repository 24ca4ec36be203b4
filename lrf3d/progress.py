"""Progress of work in steps."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the number of finished steps, and the number of all."""


def silent(done: int, total: int) -> None:
    """Report nothing."""
