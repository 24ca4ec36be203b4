"""Runs: what a simulation was made of and what came out, kept whole."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from lrf3d.geometry import Float, Int, Value
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.mapped import some_rows
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker, numbers_by_truth
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.touching import joined_objects

if TYPE_CHECKING:
    from lrf3d.casting.mover import Mover

MAP_SNAPSHOTS = 100
"""How many stages of the growing map a run keeps at most: enough for a film, and each takes the
mapper some hundredths of a second to work out."""


@dataclass(frozen=True, eq=False)
class Run(Value):
    """What a simulation was made of and what came out; all that pictures and films need.

    Args:
        world: The walls that were driven through.
        lrf: The laser range finder.
        trajectory: Times (k,) and poses (k, 3) of the scans.
        ranges: (k, beams) measured ranges [m], with noise.
        truth: (k, beams) true ranges [m].
        walls: (k, beams) index of the segment that each beam hit, or −1.
        stages: Scans after which the map was kept, rising; the last is the last scan. None where
            the mapper makes no LineMap.
        maps: The map at each of the stages.
        movers: What moved in the world beside the robot.
        film: How the run is filmed if nothing else is given.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> len(run), run.ranges.shape
        (2, (2, 181))
        >>> run.scan(1).pose.x
        2.0
    """

    world: World
    lrf: LaserRangeFinder
    trajectory: Trajectory
    ranges: Float
    truth: Float
    walls: Int
    stages: tuple[int, ...]
    maps: tuple[LineMap, ...]
    movers: "tuple[Mover, ...]" = ()
    film: FilmPlan = USUAL_FILM

    def __post_init__(self) -> None:
        self._hold("ranges", "truth")
        self._hold("walls", dtype=np.int64)

    def __repr__(self) -> str:
        name = f"{self.world.name!r}, " if self.world.name else ""
        return (
            f"Run({name}{len(self)} scans of {self.lrf.beams} beams,"
            f" {self.trajectory.length:.1f} m in {self.trajectory.duration:.1f} s,"
            f" {len(self.map)} segments in {self.map.object_count} objects)"
        )

    def __len__(self) -> int:
        return len(self.trajectory)

    @property
    def map(self) -> LineMap:
        """The map after the last scan; an empty one where the mapper makes no LineMap."""
        return self.maps[-1] if self.maps else LineMap.empty()

    def stage_after(self, scan: int) -> int:
        """The newest stage whose map holds no scan after the given one; −1 for none."""
        return int(np.searchsorted(self.stages, scan, side="right")) - 1

    def map_after(self, scan: int) -> LineMap:
        """The newest kept map that holds no scan after the given one."""
        stage = self.stage_after(scan)
        return self.maps[stage] if stage >= 0 else LineMap.empty()

    @cached_property
    def lasting_objects(self) -> tuple[Int, ...]:
        """For each kept map the object (m,) of each segment, by numbers that last.

        An object has one number in all maps of the run, and where the last map shows a true
        object, it is the number of that: pictures and films give each its colour and name by it.
        """
        tracker = ObjectTracker()
        stages = [tracker.follow(line_map) for line_map in self.maps]
        if not stages:
            return ()
        world = self.world
        objects = joined_objects(world)
        known = numbers_by_truth(stages[-1], self.map, world.segments, objects)
        lasting = np.array([known.get(n, -1) for n in range(tracker.count)], np.int64)
        unknown = np.flatnonzero(lasting < 0)
        lasting[unknown] = world.object_count + np.arange(len(unknown))
        return tuple(lasting[stage] for stage in stages)

    def part(self, scans: Int) -> "Run":
        """The run of some of its scans, rising, and of the last of its maps."""
        part = replace(
            self,
            trajectory=Trajectory(self.trajectory.times[scans], self.trajectory.poses[scans]),
            ranges=some_rows(self.ranges, scans),
            truth=some_rows(self.truth, scans),
            walls=some_rows(self.walls, scans),
            stages=(len(scans) - 1,) if self.maps else (),
            maps=self.maps[-1:],
        )
        # Its map is that of the whole, and so are the numbers of the objects in it.
        part.__dict__["lasting_objects"] = self.lasting_objects[-1:]
        return part

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

    def free_cells(self) -> FreeCells:
        """What the measured scans saw to be free, as :func:`save_map` keeps it beside the map."""
        # Reading a world needs no compiled code.
        from lrf3d.laser.free_space import distinct_poses, free_cells

        chosen = distinct_poses(self.trajectory.poses)
        return free_cells([self.scan(index) for index in chosen.tolist()])

    @property
    def scans(self) -> Iterator[LaserScan]:
        """The measured scans, one after the other."""
        return (self.scan(index) for index in range(len(self)))


@dataclass(frozen=True, slots=True)
class Stages:
    """After which scans of a run the map is kept.

    Args:
        scans: How many scans the run will have, at most.
        snapshots: After how many of them the map is kept, at most; MAP_SNAPSHOTS if not given.
    """

    scans: int
    snapshots: int | None = None

    def holds(self, index: int) -> bool:
        """Whether the map is kept after a scan; after the last it is, as after each of a few."""
        most = MAP_SNAPSHOTS if self.snapshots is None else self.snapshots
        return (index + 1) * most // self.scans > index * most // self.scans


def run_bytes(scans: int, beams: int) -> int:
    """How many bytes the scans of a run take on disk."""
    return 8 * scans * (4 + 3 * beams)
