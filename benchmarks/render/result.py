"""What ``bench render`` measured, and the ratios that it is meant to keep to."""

import platform
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lrf3d.cores import core_count
from lrf3d.study.bench.ablation import Saving
from lrf3d.study.bench.ratios import Ratio
from lrf3d.study.timing import Timing

PICTURE = (1280, 720)
"""Width and height of the pictures [pixels]."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """One way to draw one world.

    Args:
        world: Name of the world.
        buildings: How many there are in it.
        title: What draws it.
        samples: Samples a pixel.
        timing: Time of a frame.
        error: Root mean square error of its picture, of 255; None where it was not measured.
    """

    world: str
    buildings: int
    title: str
    samples: int
    timing: Timing
    error: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """The entry in JSON's types."""
        return {
            "world": self.world,
            "buildings": self.buildings,
            "title": self.title,
            "samples": self.samples,
            "frame": self.timing.as_dict(),
            "error_rms": self.error,
        }


@dataclass
class RenderBenchmark:
    """What was measured.

    Args:
        entries: Each way to draw each world.
        layers: What each layer of the full look costs in the city, without smoothing [s].
        savings: What skipping work saves; empty where it was not asked for.
        load: Processes of others that waited or ran before, on average; None where unknown.
        took: How long all took [s].
    """

    entries: list[Drawn] = field(default_factory=list)
    layers: dict[str, float] = field(default_factory=dict)
    savings: list[Saving] = field(default_factory=list)
    load: float | None = None
    took: float = 0.0

    def median(self, title: str, world: str, samples: int) -> float:
        """Median time [s] of an entry; NaN where there is none."""
        found = [
            entry.timing.median
            for entry in self.entries
            if (entry.title, entry.world, entry.samples) == (title, world, samples)
        ]
        return found[0] if found else float("nan")

    @property
    def ratios(self) -> list[Ratio]:
        """What is promised of the city on four cores, and of growth."""
        ours, full = self.median("lrf3d", "city", 0), self.median("lrf3d", "city", 4)
        stock = self.median("stock pyrender", "city", 4)
        found = [
            Ratio("frame without smoothing, city [ms]", 1e3 * ours, 12.0),
            Ratio("frame with 4 samples, city [ms]", 1e3 * full, 25.0),
            Ratio("stock pyrender / lrf3d, city, both 4 samples", stock / full, 8.0, True),
            Ratio("stock pyrender / lrf3d without smoothing, city", stock / ours, 8.0, True),
        ]
        grown = sorted(
            (entry.buildings, entry.timing.median)
            for entry in self.entries
            if entry.title == "lrf3d" and entry.world != "city"
        )
        if len(grown) > 1:
            (few, small), (many, large) = grown[0], grown[-1]
            found.append(Ratio(f"frame of {many:,} buildings / of {few:,}", large / small, 1.5))
        return [ratio for ratio in found if np.isfinite(ratio.value)]

    def as_dict(self) -> dict[str, Any]:
        """The benchmark in JSON's types."""
        return {
            "benchmark": "render",
            "machine": {"system": platform.platform(), "cores": core_count(), "load": self.load},
            "size": list(PICTURE),
            "entries": [entry.as_dict() for entry in self.entries],
            "layers_s": self.layers,
            "ratios": [ratio.as_dict() for ratio in self.ratios],
            "savings": [saving.as_dict() for saving in self.savings],
            "took_s": self.took,
        }
