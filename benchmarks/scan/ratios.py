"""Ratios: what a benchmark promises, each one number measured in one run, beside its bound."""

from dataclasses import dataclass
from typing import Any

from lrf3d.cores import core_count
from lrf3d.study.bench.contest import USUAL, Entry

HUGE = 1_000_000
"""Walls of the huge city that promises speak of, beside the usual one."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """A ratio of two measured figures.

    Args:
        name: What is divided by what.
        value: The ratio.
        bound: What it is meant to keep to.
        at_least: Whether the bound is the least that it may be, else the most.
    """

    name: str
    value: float
    bound: float
    at_least: bool = False

    @property
    def kept(self) -> bool:
        """Whether the ratio keeps to its bound."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound

    def as_dict(self) -> dict[str, Any]:
        """The ratio in JSON's types."""
        return {
            "ratio": self.name,
            "value": self.value,
            "bound": self.bound,
            "sense": "at least" if self.at_least else "at most",
            "kept": self.kept,
        }


def ratios(entries: list[Entry]) -> list[Ratio]:
    """The ratios that can be formed from what was measured."""
    by = {(entry.rival.key, entry.walls): entry for entry in entries}
    found = []

    def single(name: str, a: tuple[str, int], b: tuple[str, int], bound: float) -> None:
        if a in by and b in by:
            found.append(Ratio(name, by[a].single.median / by[b].single.median, bound))

    here = f"one scan, {USUAL} walls"
    single(f"{here}: PlanarCaster / Embree float32", ("planar", USUAL), ("raw", USUAL), 0.7)
    single(f"{here}: EmbreeCaster / Embree float32", ("embree", USUAL), ("raw", USUAL), 1.6)
    single(f"{here}: EmbreeCaster / trimesh location", ("embree", USUAL), ("location", USUAL), 0.5)
    huge = by.get(("planar", HUGE))
    if huge is not None and huge.usual is not None:
        name = f"one scan: PlanarCaster at {HUGE:,} / {USUAL} walls"
        found.append(Ratio(name, huge.single.median / huge.usual.median, 1.3))
    for key in ("planar", "embree"):
        entry, peer = by.get((key, USUAL)), by.get(("open3d", USUAL))
        if entry is None or entry.batch is None or entry.alone is None:
            continue
        title = f"batch, {USUAL} walls: {entry.rival.title}"
        if peer is not None and peer.batch is not None:
            faster = peer.batch.median / entry.batch.median
            found.append(Ratio(f"{title} / Open3D, rays a second", faster, 1.5, at_least=True))
        gain = entry.alone.median / entry.batch.median / core_count()
        found.append(Ratio(f"{title}, all cores / (cores × one core)", gain, 0.8, at_least=True))
    if huge is not None and huge.index is not None:
        per_wall = huge.index / huge.walls
        found.append(Ratio(f"index of PlanarCaster, {HUGE:,} walls, bytes a wall", per_wall, 100.0))
    return found
