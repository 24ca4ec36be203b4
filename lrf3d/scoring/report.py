"""Report: a value whose numbers go into a summary file."""

from dataclasses import fields
from math import isfinite
from typing import Any


class Report:
    """A dataclass of counts and figures that can be written as JSON."""

    __slots__ = ()

    def as_dict(self) -> dict[str, Any]:
        """The figures by name; None where a figure has no finite value, as JSON knows none."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        return {name: value if isfinite(value) else None for name, value in values.items()}
