"""Simulation: a robot drives, scans and maps, step by step, as in Fig. 2 of Teslić et al.

A world and a drive enter; steps leave as they come, and nothing is kept but what the mapper keeps.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypedDict

import numpy as np

from lrf3d.casting import EmbreeCaster
from lrf3d.casting.mover import Mover
from lrf3d.casting.timed import Caster, timed
from lrf3d.errors import InputError
from lrf3d.geometry import Float, numbers, whole_number
from lrf3d.laser import LaserRangeFinder, LaserScan, Noise, ProportionalNoise
from lrf3d.laser.noise import AnyNoise, as_noise
from lrf3d.mapping import LineMapper
from lrf3d.pose import Pose
from lrf3d.robot import Trajectory
from lrf3d.steering import Controller, Drive, Recorded, Steered
from lrf3d.world import World

SCAN_INTERVAL = 0.1
"""Time between two scans [s] of a controller's drive where none is given: 10 Hz, as is usual."""


class Mapper(Protocol):
    """Anything that builds a map from scans.

    What `update` returns is the map after this scan, a LineMap or anything else; where it returns
    None, it is the mapper's attribute ``map``, if there is one.
    """

    def update(self, scan: LaserScan) -> Any:
        """Take in a scan and return the map."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a simulation: a scan, and what came of it.

    Args:
        index: Number of the scan, from 0.
        time: When it was taken [s].
        pose: Pose x, y [m], theta [rad] that it was taken at.
        scan: The measured scan.
        true_scan: The scan without noise.
        map: The map after this scan, whatever the mapper makes.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> step = next(iter(lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)])))
        >>> step.index, step.time, len(step.scan.ranges)
        (0, 0.0, 181)
    """

    index: int
    time: float
    pose: Pose
    scan: LaserScan
    true_scan: LaserScan
    map: Any


class Settings(TypedDict, total=False):
    """What a simulation may be told beside its world, its drive and its range finder."""

    caster: Caster | None
    noise: AnyNoise | None
    mapper: Mapper | None
    rng: np.random.Generator | int | None
    movers: Sequence[Mover]
    start: Sequence[float] | Float
    scan_interval: float
    scans: int | None
    radius: float | None


class Simulation:
    """A robot with a laser range finder that drives through a world; its steps come one by one.

    ``for step in simulation`` scans, maps and drives on at each turn. It may be left at any time,
    and goes on where it was left. What is passed by is not kept, so that it may go on for ever.

    Args:
        world: The walls.
        drive: A Trajectory, poses (k, 3) a second apart, or a controller: anything with
            ``command(time, pose, scan) -> (v, w)``, speed [m/s] and turn rate [rad/s] up to the
            next scan, or None to end the drive.
        lrf: The laser range finder; 181 beams over 180° up to 80 m where not given.
        caster: What casts the beams; Embree where not given.
        noise: What makes measured scans of true ones, ``noise(scan, rng)`` or ``noise(scan)``;
            none where not given.
        mapper: What builds the map, anything with ``update(scan)``; a LineMapper where not given.
        rng: The source of the noise, or a seed of it.
        movers: What moves in the world beside the robot and is seen by it.
        start: Pose where a controller's drive begins; the origin where not given.
        scan_interval: Time between two scans [s] of a controller's drive.
        scans: After how many scans to end; where not given, at the end of a trajectory, and never
            where a controller drives on.
        radius: With a controller: radius of the robot [m], which may not run into a wall; where
            not given, it drives through them.

    Raises:
        InputError: The drive or the noise is none, or a scan takes longer than the time to the
            next.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> simulation = lrf3d.Simulation(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> [step.pose.x for step in simulation]
        [1.0, 2.0]
    """

    def __init__(
        self,
        world: World,
        drive: Trajectory | Float | Controller,
        lrf: LaserRangeFinder | None = None,
        *,
        caster: Caster | None = None,
        noise: AnyNoise | None = None,
        mapper: Mapper | None = None,
        rng: np.random.Generator | int | None = None,
        movers: Sequence[Mover] = (),
        start: Sequence[float] | Float = (0.0, 0.0, 0.0),
        scan_interval: float = SCAN_INTERVAL,
        scans: int | None = None,
        radius: float | None = None,
    ) -> None:
        if scans is not None:
            scans = whole_number(scans, "scans")
        self.world = world
        self.lrf = LaserRangeFinder() if lrf is None else lrf
        self.noise: Noise = ProportionalNoise(0.0) if noise is None else as_noise(noise)
        self.mapper: Mapper = LineMapper() if mapper is None else mapper
        if not callable(getattr(self.mapper, "update", None)):
            raise InputError(f"mapper {self.mapper!r}: expected an object with update(scan)")
        self.rng = np.random.default_rng(rng)
        self.movers = tuple(movers)
        self.drive: Drive
        caster = EmbreeCaster(world) if caster is None else caster
        if callable(getattr(drive, "command", None)):
            self.drive = Steered(drive, start, scan_interval, world, radius)  # type: ignore[arg-type]
            if self.lrf.scan_duration:
                raise InputError(
                    "scan_duration: a controller decides after a scan where the robot moves, so"
                    " that its scans take no time; set it to 0"
                )
            self._cast = timed(caster, self.lrf, None, movers)
        else:
            if not isinstance(drive, Trajectory):
                poses = numbers(drive, "poses")
                drive = Trajectory(np.arange(len(poses) if poses.ndim else 0), poses)
            self.drive = Recorded(drive)
            self._cast = timed(caster, self.lrf, drive, movers)
            scans = len(drive) if scans is None else min(scans, len(drive))
        self.scans = scans
        self.done = 0
        self.map: Any = getattr(self.mapper, "map", None)

    def __iter__(self) -> Iterator[Step]:
        """The steps that are still to come.

        Raises:
            CollisionError: A controller drives a robot with a radius into a wall.
        """
        while (self.scans is None or self.done < self.scans) and self.drive.goes_on:
            index, (time, pose) = self.done, self.drive.place(self.done)
            true_scan = self._cast.cast_at(self.lrf, pose, time)
            scan = self.noise(true_scan, self.rng)
            self._check_measured(scan)
            self.take(scan)
            yield Step(index, time, true_scan.pose, scan, true_scan, self.map)

    def _check_measured(self, scan: Any) -> None:
        """See that a noise has returned a scan.

        Raises:
            InputError: It has not.
        """
        if not isinstance(scan, LaserScan) or len(scan.ranges) != self.lrf.beams:
            raise InputError(
                f"noise {self.noise!r} returned {_shown(scan)}; expected a LaserScan of"
                f" {self.lrf.beams} beams"
            )
        # NaN is the least where there is one, and −inf is a beam that is nearer than range_min.
        if not scan.ranges.min() >= 0.0:
            wrong = ~(scan.ranges >= 0.0) & (scan.ranges != -np.inf)
            if wrong.any():
                beam = int(np.argmax(wrong))
                raise InputError(
                    f"noise {self.noise!r} returned the range {scan.ranges[beam]:g} m of beam"
                    f" {beam}; expected 0 or more, inf for no return, -inf for one too near"
                )

    def take(self, scan: LaserScan, *, mapped: bool = False) -> None:
        """Take the next scan as measured: map it and drive on.

        Args:
            scan: The scan; where scans were kept, they bring a new simulation to where an older
                one was left.
            mapped: Whether the mapper knows it already.
        """
        if not mapped:
            found = self.mapper.update(scan)
            self.map = getattr(self.mapper, "map", None) if found is None else found
        self.drive.after(scan)
        self.done += 1


def _shown(scan: Any) -> str:
    """What a noise has returned, in a few words."""
    if isinstance(scan, LaserScan):
        return f"one of {len(scan.ranges)}"
    return "None" if scan is None else f"a {type(scan).__name__}"
