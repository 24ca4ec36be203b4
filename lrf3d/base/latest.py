"""The newest values that were made, so that asking again for one of them costs nothing."""

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")


class Latest:
    """Keeps the values of the keys that were asked for last, ``size`` at most.

    Keys are compared as those of a dict: objects without an equality of their own by identity.
    """

    def __init__(self, size: int = 1) -> None:
        self.size = size
        self._values: dict[Hashable, Any] = {}

    def of(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key, made if it is not among the newest."""
        value: T = self._values.pop(key) if key in self._values else make()
        self._values[key] = value
        if len(self._values) > self.size:
            del self._values[next(iter(self._values))]
        return value
