"""How many numbers does a map take as unions of segments, as polylines and as a grid?

The comparison of section 4 of Teslić et al., on the whole drive through the built-in city.
"""

from dataclasses import dataclass
from typing import Any

from lrf3d.casting import PlanarCaster
from lrf3d.laser import ProportionalNoise
from lrf3d.mapping import LineMapper
from lrf3d.scenario import SIGMA
from lrf3d.scoring import StorageCount, storage
from lrf3d.simulation import simulate
from lrf3d.study.bench.map_accuracy import CityDrive
from lrf3d.study.summary import local_polylines


@dataclass(frozen=True, slots=True)
class MemoryEntry:
    """What the map of a drive takes to store.

    Args:
        mode: Mode of the mapper.
        scans: How many scans.
        count: What it takes.
    """

    mode: str
    scans: int
    count: StorageCount

    def as_dict(self) -> dict[str, Any]:
        """The entry in JSON's types."""
        return {"mode": self.mode, "scans": self.scans, **self.count.as_dict()}


def measure_memory(mode: str, *, scans: int | None = None) -> MemoryEntry:
    """Count what the map of a drive through the city takes.

    Args:
        mode: Mode of the mapper.
        scans: How many scans from the beginning of the drive; all where not given.
    """
    drive = CityDrive(scans=scans)
    scenario = drive.scenario
    mapper = LineMapper(mode, sigma=SIGMA)
    run = simulate(
        scenario.world,
        drive.trajectory,
        scenario.lrf,
        caster=PlanarCaster(scenario.world),
        noise=ProportionalNoise(SIGMA),
        mapper=mapper,
        rng=0,
    )
    polylines = [local_polylines(mapper.local_map(scan)) for scan in run.scans]
    return MemoryEntry(mode, len(run), storage(run, polylines))
