"""The simulation: a robot drives, scans and maps, as in Fig. 2 of Teslić et al."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from lrf3d.geometry import Float, Int
from lrf3d.laser import LaserRangeFinder, LaserScan, Noise, ProportionalNoise
from lrf3d.mapping import LineMap
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.world import World

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover
    from lrf3d.casting.timed import Caster

MAP_SNAPSHOTS = 100
"""How many stages of the growing map a run keeps at most: enough for a film, and each takes the
mapper some hundredths of a second to work out."""


class Mapper(Protocol):
    """Anything that builds a map from scans."""

    def update(self, scan: LaserScan) -> LineMap:
        """Take in a scan and return the map."""
        ...


@dataclass(frozen=True, eq=False)
class Run:
    """What a simulation was made of and what came out; all that pictures and films need.

    Args:
        world: The walls that were driven through.
        lrf: The laser range finder.
        trajectory: Times (k,) and poses (k, 3) of the scans.
        ranges: (k, beams) measured ranges [m], with noise.
        truth: (k, beams) true ranges [m].
        walls: (k, beams) index of the segment that each beam hit, or −1.
        stages: Scans after which the map was kept, rising; the last is the last scan.
        maps: The map at each of the stages.
    """

    world: World
    lrf: LaserRangeFinder
    trajectory: Trajectory
    ranges: Float
    truth: Float
    walls: Int
    stages: tuple[int, ...]
    maps: tuple[LineMap, ...]

    def __len__(self) -> int:
        return len(self.trajectory)

    @property
    def map(self) -> LineMap:
        """The map after the last scan."""
        return self.maps[-1]

    def map_after(self, scan: int) -> LineMap:
        """The newest kept map that holds no scan after the given one."""
        stage = int(np.searchsorted(self.stages, scan, side="right")) - 1
        return self.maps[stage] if stage >= 0 else LineMap.empty()

    def scan(self, index: int) -> LaserScan:
        """The measured scan of an index from 0."""
        return LaserScan(
            Pose(*self.trajectory.poses[index].tolist()),
            self.lrf.angles,
            self.ranges[index],
            self.walls[index],
            range_min=self.lrf.range_min,
            range_max=self.lrf.range_max,
            time=float(self.trajectory.times[index]),
            time_increment=self.lrf.time_increment,
        )

    def true_scan(self, index: int) -> LaserScan:
        """The scan of an index from 0 without noise."""
        return replace(self.scan(index), ranges=self.truth[index])

    @property
    def scans(self) -> Iterator[LaserScan]:
        """The measured scans, one after the other."""
        return (self.scan(index) for index in range(len(self)))


def simulate(
    world: World,
    trajectory: Trajectory | Float,
    lrf: LaserRangeFinder | None = None,
    *,
    caster: "Caster | None" = None,
    noise: Noise | None = None,
    mapper: Mapper | None = None,
    rng: np.random.Generator | int | None = None,
    movers: "Sequence[Mover]" = (),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Run:
    """Drive through a world, scan at every pose, and map.

    Args:
        world: The walls.
        trajectory: Times and poses of the drive, or only poses (k, 3), then a second apart.
        lrf: The laser range finder; 181 beams over 180° up to 80 m where not given.
        caster: What casts the beams; Embree where not given.
        noise: What makes measured ranges of true ones; none where not given.
        mapper: What builds the map, anything with ``update(scan)``; a LineMapper where not given.
        rng: The source of the noise, or a seed of it.
        movers: What moves in the world beside the robot and is seen by it.
        progress: Called with the scans that are done and all.

    Raises:
        InputError: The trajectory is none, or a scan takes longer than the time to the next.
    """
    if not isinstance(trajectory, Trajectory):
        trajectory = Trajectory(np.arange(len(trajectory)), trajectory)
    lrf = LaserRangeFinder() if lrf is None else lrf
    # Films and figures read runs without casting a beam; they need not wait for compilers.
    from lrf3d.casting import EmbreeCaster
    from lrf3d.casting.timed import timed

    cast = timed(EmbreeCaster(world) if caster is None else caster, lrf, trajectory, movers)
    noise = ProportionalNoise(0.0) if noise is None else noise
    if mapper is None:
        from lrf3d.mapping import LineMapper

        mapper = LineMapper()
    rng = np.random.default_rng(rng)
    count = len(trajectory)
    ranges, truth = np.empty((count, lrf.beams)), np.empty((count, lrf.beams))
    walls = np.empty((count, lrf.beams), dtype=np.int64)
    stages, maps = [], []
    for index, (time, pose) in enumerate(zip(trajectory.times, trajectory.poses, strict=True)):
        true_scan = cast.cast_at(lrf, pose, float(time))
        scan = noise(true_scan, rng)
        line_map = mapper.update(scan)
        truth[index], walls[index], ranges[index] = true_scan.ranges, true_scan.walls, scan.ranges
        # The last scan is always a stage, and so is every scan of a short run.
        if (index + 1) * MAP_SNAPSHOTS // count > index * MAP_SNAPSHOTS // count:
            stages.append(index)
            maps.append(line_map)
        progress(index + 1, count)
    return Run(world, lrf, trajectory, ranges, truth, walls, tuple(stages), tuple(maps))
