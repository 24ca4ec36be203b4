"""Report: base class of the figures in summary files."""

from dataclasses import fields
from math import isfinite
from typing import Any


class Report:
    """A dataclass of counts and figures that can be written as JSON."""

    __slots__ = ()

    def as_dict(self) -> dict[str, Any]:
        """The figures by name; None for values that are not finite, which JSON lacks."""
        values = {each.name: getattr(self, each.name) for each in fields(self)}  # type: ignore[arg-type]
        return {name: value if isfinite(value) else None for name, value in values.items()}
