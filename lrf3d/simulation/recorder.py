"""Recording in memory: a simulation, or a user's own loop, is kept as a Run.

A simulation or its parts enter, or the scans of a user's own loop; a Run in memory leaves.
`lrf3d.recordings.formats.recording` keeps the same rows in a file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from inspect import signature
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.base.errors import InputError, check_names, each_of, expect, shown
from lrf3d.base.interrupts import Progress, check, silent, stoppable
from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.geometry.lines import LARGEST_TIME, Float, number, sealed, whole_number
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser.range_finder import LaserRangeFinder, lasers_of
from lrf3d.laser.scan import LIGHT, LaserScan
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.robot.odometry import ImuRecord
from lrf3d.simulation.loop import Simulation, Step
from lrf3d.simulation.run import Run, is_snapshot
from lrf3d.simulation.steering import Controller
from lrf3d.world import World


class Runnable(Protocol):
    """Anything that can be simulated, such as a Scenario."""

    def simulation(self, **changes: Any) -> Simulation:
        """Its simulation, with the given changes."""


def simulate(
    world: World | Runnable,
    drive: Trajectory | ArrayLike | Controller | None = None,
    lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None = None,
    *,
    snapshots: int | None = None,
    progress: Progress = silent,
    **settings: Any,
) -> Run:
    """Drive through a world, scan, map, and keep all of it in memory.

    `Simulation` does the same step by step, and its other arguments are the settings, such as
    ``rng``, ``noise`` and ``mapper``. Those of a Scenario are the arguments of
    `Scenario.simulation`; the run then equals that of ``lrf3d run``.

    Args:
        world: A Scenario, or the walls alone, for which a drive is required.
        drive: A Trajectory, poses (k, 3) a second apart, or a controller.
        lrf: The laser range finder, or several.
        snapshots: Largest number of map snapshots that the run keeps, for films; 100 if not given.
            With 1 only the final map is computed, which is faster.
        progress: Called with the number of finished scans, and of all.
        **settings: ``caster``, ``noise``, ``mapper``, ``rng``, ``obstacles``, ``start``,
            ``scan_interval``, ``scans``, ``radius``, ``outline``, ``on_collision``, ``odometry``,
            ``imu``, ``film`` and ``robot``.

    Raises:
        InputError: An argument is invalid, a scan takes longer than the interval to the next, or a
            controller's drive has no number of scans.
        CollisionError: A robot with a radius would hit a wall.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> noise = lrf3d.ProportionalNoise(sigma=0.02)
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], noise=noise, rng=0)
        >>> len(run), len(run.map) > 0
        (2, True)
        >>> len(lrf3d.simulate(lrf3d.load_scenario("city"), scans=3, rng=0))
        3
    """
    given = {"lrf": lrf, **settings}
    settings = {name: value for name, value in given.items() if value is not None}
    if isinstance(world, World):
        if drive is None:
            raise InputError(
                "drive: not given, and a world alone has none; give one, or a scenario"
            )
        check_names("simulate", settings, list(signature(Simulation).parameters))
        simulation = Simulation(world, drive, **settings)
    elif hasattr(world, "simulation"):
        simulation = world.simulation(drive=drive, **settings)
    else:
        raise InputError(
            f"simulate: {shown(world)}: expected a World or a Scenario, such as"
            " load_scenario('city')"
        )
    return collect(simulation, progress, snapshots=snapshots)


@stoppable()
def collect(
    simulation: Simulation, progress: Progress = silent, *, snapshots: int | None = None
) -> Run:
    """Run a simulation to its end and keep it in memory; `record` writes it to a file."""
    expect(progress, Callable, "progress")
    collection = Collection(simulation, snapshots)
    total = simulation.total
    for step in simulation:
        collection.add(step)
        progress(simulation.done, total)
    return collection.run()


class Snapshots:
    """The map snapshots of a simulation while it runs, and what its IMU measured."""

    def __init__(self, simulation: Simulation, snapshots: int | None = None) -> None:
        self._simulation = simulation
        self._total = simulation.total
        self.maps: dict[int, LineMap] = {}
        self._most = None if snapshots is None else whole_number(snapshots, "snapshots")
        self._inertial = list[Float]()

    def keep(self) -> None:
        """Keep what came with the last scan."""
        self._inertial.append(self._simulation.inertial)
        if is_snapshot(self._simulation.done - 1, self._total, self._most):
            self._keep_map()
        check()

    def end(self) -> ImuRecord | None:
        """Keep the last map, as a controller may end before all scans are done."""
        self._keep_map()
        exists = self._simulation.motion_sensors[1] is not None
        return ImuRecord.of(self._inertial) if exists else None

    def _keep_map(self) -> None:
        last = self._simulation.done - 1
        line_map = self._simulation.map
        if last not in self.maps and isinstance(line_map, LineMap):
            self.maps[last] = line_map


class Collection(Snapshots):
    """All of a simulation, in memory."""

    def __init__(self, simulation: Simulation, snapshots: int | None = None) -> None:
        super().__init__(simulation, snapshots)
        self._rows = Rows(
            simulation.world, simulation.lasers, simulation.motion_shapes, self._total
        )

    def add(self, step: Step) -> None:
        """Keep a step."""
        self._rows.add(*measured_in(step))
        self.keep()

    def run(self) -> Run:
        """The run of the simulation, which has ended."""
        simulation = self._simulation
        return self._rows.run(
            self.maps,
            obstacles=simulation.obstacles,
            film=simulation.film,
            radius=simulation.radius,
            estimate=simulation.estimate,
            # It also keeps the last map.
            imu=self.end(),
            cloud_sensors=simulation.cloud_sensors,
        )


def measured_in(step: Step) -> tuple[Any, ...]:
    """The measurements of a step: the arguments of `fill_row`, from the time on."""
    motion = {"wheels": step.odometry, "sweeps": step.sweeps, "attitudes": step.attitude}
    return step.time, step.pose, step.scans, step.true_scans, motion


def row_type(
    world: World,
    lasers: Sequence[LaserRangeFinder],
    motion: Mapping[str, tuple[int, ...]] = {},
) -> np.dtype[Any]:
    """What a run keeps of each scan: a field for each of the Run's attributes.

    Those of the robot's motion have the shapes of `Simulation.motion_shapes`.
    """
    beams = (sum(each.beams for each in lasers),)
    echoes = lasers[0].echoes
    fields: list[Any] = [
        ("times", np.float64), ("poses", np.float64, 3), ("ranges", np.float64, beams),
        ("truth", np.float64, beams), ("walls", np.int64, beams),
    ]  # fmt: skip
    if world.materials:
        fields.append(("intensities", np.float64, beams))
        if echoes > 1:
            names = ("echoes", "echo_intensities")
            fields += [(name, np.float64, (*beams, echoes)) for name in names]
    if any(each.scan_duration for each in lasers):
        fields.append(("motions", np.float64, (len(lasers), 3)))
    fields += [(name, np.float64, shape) for name, shape in motion.items()]
    return np.dtype(fields)


def fill_row(
    rows: Mapping[str, Any],
    index: int,
    time: float,
    pose: Pose,
    scans: Sequence[LaserScan],
    true_scans: Sequence[LaserScan],
    motion: Mapping[str, Any] = {},
) -> None:
    """Write what a step measured into a row of arrays with the fields of `row_type`."""
    rows["times"][index] = time
    rows["poses"][index] = pose
    for name in rows.keys() & motion.keys():
        rows[name][index] = motion[name]
    begin = 0
    for laser, (scan, truth) in enumerate(zip(scans, true_scans, strict=True)):
        beams = slice(begin, begin := begin + len(scan.ranges))
        rows["ranges"][index, beams] = scan.ranges
        rows["truth"][index, beams] = truth.ranges
        rows["walls"][index, beams] = truth.walls
        if "motions" in rows:
            rows["motions"][index, laser] = 0.0 if truth.motion is None else truth.motion
        for name in rows.keys() & set(LIGHT):
            # Scans of users' own parts may have no intensities.
            light = getattr(scan, name)
            rows[name][index, beams] = np.nan if light is None else light


class Rows:
    """Arrays with a row for each scan, by the names of a Run's attributes; they grow on demand."""

    def __init__(
        self,
        world: World,
        lasers: tuple[LaserRangeFinder, ...],
        motion: Mapping[str, tuple[int, ...]] = {},
        room: int = 1,
    ) -> None:
        self._world = world
        self._lasers = lasers
        row = row_type(world, lasers, motion)
        self._arrays: dict[str, Any] = {
            name: np.empty((room, *row[name].shape), row[name].base) for name in row.names or ()
        }
        self._room = room
        self.count = 0

    def add(self, *measured: Any) -> None:
        """Keep what a step measured: the arguments of `fill_row`, from the time on."""
        if self.count == self._room:
            self._room = 2 * self.count
            kept = {name: values[: self.count] for name, values in self._arrays.items()}
            self._arrays = {name: np.concatenate([each, each]) for name, each in kept.items()}
        fill_row(self._arrays, self.count, *measured)
        self.count += 1

    def run(self, maps: Mapping[int, LineMap], **parts: Any) -> Run:
        """The run so far, with map snapshots by their scans; a scan after that copies all rows."""
        self._room = self.count
        rows = {name: sealed(values)[: self.count] for name, values in self._arrays.items()}
        return Run(
            self._world,
            self._lasers[0],
            Trajectory(rows.pop("times"), rows.pop("poses")),
            snapshot_scans=tuple(maps),
            maps=tuple(maps.values()),
            further=self._lasers[1:],
            **rows,
            **parts,
        )


class Recorder:
    """Keeps the scans and maps of a loop.

    Args:
        world: The walls.
        lrf: The laser range finder, or several.
        obstacles: The dynamic obstacles, for pictures and films.

    Examples:
        >>> import lrf3d
        >>> room, lrf = lrf3d.load_world("paper_room"), lrf3d.LaserRangeFinder()
        >>> caster, mapper = lrf3d.EmbreeCaster(room), lrf3d.LineMapper()
        >>> recorder = lrf3d.Recorder(room, lrf)
        >>> for x in (1.0, 1.5, 2.0):
        ...     scan = caster.cast(lrf, (x, 1, 0))
        ...     mapper.update(scan)
        ...     recorder.add(scan, map=mapper.map)
        >>> run = recorder.run()
        >>> len(run), run.trajectory.length, len(run.map) > 0
        (3, 1.0, True)
    """

    def __init__(
        self,
        world: World,
        lrf: LaserRangeFinder | Sequence[LaserRangeFinder],
        *,
        obstacles: Sequence[DynamicObstacle] = (),
    ) -> None:
        expect(world, World, "recorder: world")
        self._lasers = lasers_of(lrf)
        self._obstacles = tuple(each_of(obstacles, DynamicObstacle, "recorder: obstacle"))
        self._rows = Rows(world, self._lasers)
        self._last = -math.inf
        self._estimates = list[Pose]()
        self._maps: dict[int, LineMap] = {}

    def __len__(self) -> int:
        return self._rows.count

    def add(
        self,
        scan: LaserScan | Sequence[LaserScan],
        *,
        map: LineMap | None = None,
        truth: LaserScan | Sequence[LaserScan] | None = None,
        estimate: Sequence[float] | Float | None = None,
        time: float | None = None,
    ) -> None:
        """Add a scan, whose pose is the true one of its laser.

        Args:
            scan: The measured scan, or those of all lasers at one moment.
            map: The map after it.
            truth: The same without noise; the measured one if not given.
            estimate: The robot's estimate of its pose, for every scan or none.
            time: Time [s]; if not given that of the scan, or 0.25 s after the last where it is not
                later.

        Raises:
            InputError: It is no scan of these lasers, the map is no LineMap, or the time is not
                later than that of the last scan.
        """
        scans = self._scans(scan)
        true = self._scans(scan if truth is None else truth)
        if map is not None:
            expect(map, LineMap, "recorder: map")
        later = scans[0].time if scans[0].time > self._last else self._last + SCAN_INTERVAL
        time = later if time is None else time
        if number(time, "recorder: time", "seconds", least=-LARGEST_TIME) <= self._last:
            raise InputError(f"recorder: time {time:g} s; expected one after {self._last:g} s")
        if len(self) and (estimate is None) != (not self._estimates):
            raise InputError("recorder: estimate: give one for every scan or for none")
        if estimate is not None:
            self._estimates.append(as_pose(estimate))
        if map is not None:
            self._maps[len(self)] = map
        self._last = float(time)
        self._rows.add(self._last, scans[0].robot, scans, true)

    def run(self) -> Run:
        """The run so far.

        Raises:
            InputError: There is no scan in it.
        """
        if not len(self):
            raise InputError("recorder: no scans; add(scan) first")
        newest = max(self._maps, default=0)
        kept = {
            scan: line_map
            for scan, line_map in sorted(self._maps.items())
            if scan == newest or is_snapshot(scan, len(self))
        }
        run = self._rows.run(kept)
        poses = run.trajectory.poses.copy()
        poses[:, 2] = np.unwrap(poses[:, 2])
        estimates = np.array(self._estimates)
        return replace(
            run,
            trajectory=Trajectory(run.trajectory.times, poses),
            obstacles=tuple(each.until(self._last) for each in self._obstacles),
            estimate=EstimatedTrajectory(estimates) if len(estimates) else None,
        )

    def _scans(self, given: Any) -> tuple[LaserScan, ...]:
        scans = (given,) if isinstance(given, LaserScan) else given
        scans = tuple(each_of(scans, LaserScan, "recorder: scan"))
        beams = [each.beams for each in self._lasers]
        if beams != [len(each.ranges) for each in scans]:
            raise InputError(f"recorder: {shown(given)}: expected a scan of {beams} beams")
        return scans
