"""Progress of work in steps, reported to whoever watches it."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with the number of steps that are done, and the number of all."""


def silent(done: int, total: int) -> None:
    """Progress that nobody watches."""
