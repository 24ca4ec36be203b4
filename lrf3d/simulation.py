"""Simulation: a robot drives, scans and maps, step by step, as in Fig. 2 of Teslić et al.

The input is a world and a drive; steps are yielded one by one, and only the mapper keeps anything.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.errors import InputError, check_names, expect, shown
from lrf3d.geometry import Float, generator, numbers, sealed, whole_number
from lrf3d.interrupts import Progress, check, silent, stoppable
from lrf3d.laser import LaserRangeFinder, LaserScan, ProportionalNoise
from lrf3d.laser.noise import FLOOR, SIGMA, Noise, as_noise, spread_of
from lrf3d.laser.scan import LIGHT
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.pose import Pose
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.robot.unicycle import RADIUS
from lrf3d.run import Run, is_snapshot
from lrf3d.sensor import Caster, Sensor
from lrf3d.steering import ControlledDrive, Controller
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan


class Mapper(Protocol):
    """Anything that builds a map from scans.

    The map after a scan is the mapper's attribute ``map``, a LineMap or anything else. A mapper
    without it returns the map from `update`. A mapper that estimates the poses may have the
    attribute ``estimate``, an EstimatedTrajectory, which pictures and films show next to the truth.
    """

    def update(self, scan: LaserScan) -> Any:
        """Add a scan; a return value other than None is the map."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a simulation: the measured scan and the true one, and the map after it.

    The ``index`` counts from 0; the ``time`` [s] and the ``pose`` are those of the scan.

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
    _simulation: "Simulation" = field(repr=False)

    @property
    def map(self) -> Any:
        """The map after this scan, of whatever kind; read it before the next step."""
        if self._simulation.done != self.index + 1:
            raise InputError(
                f"map of step {self.index}: the simulation has gone on to scan"
                f" {self._simulation.done - 1}; read step.map before the next step"
            )
        return self._simulation.map


class Simulation:
    """A robot with a laser range finder that drives through a world, step by step.

    Each iteration of ``for step in simulation`` scans, maps and drives on. The loop may be left and
    continued at any time. Earlier steps are not kept, so a simulation can run forever.

    Args:
        world: The walls.
        drive: A Trajectory, poses (k, 3) a second apart, or a controller: anything with
            ``command(time, pose, scan) -> (v, w)``, speed [m/s] and turn rate [rad/s] up to the
            next scan, or None to end the drive.
        lrf: The laser range finder; 181 beams over 180° up to 80 m if not given.
        caster: Casts the beams: ``embree``, ``planar``, or an object with ``cast``.
        noise: Turns true scans into measured ones, ``noise(scan, rng)``; none if not given.
        mapper: Builds the map, anything with ``update(scan)``; a LineMapper set up for the noise
            if not given.
        rng: A generator for the noise, or a seed.
        obstacles: The dynamic obstacles.
        start: Initial pose of a controller's drive.
        scan_interval: Time between two scans [s] of a controller's drive.
        scans: Number of scans; if not given, those of the trajectory, or any number until a
            controller ends the drive.
        radius: Radius [m] of a controller's robot, which may not hit a wall; if not given, it
            drives through walls.

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
        drive: Trajectory | ArrayLike | Controller,
        lrf: LaserRangeFinder | None = None,
        *,
        caster: Caster | str = "embree",
        noise: Noise | None = None,
        mapper: Mapper | None = None,
        rng: np.random.Generator | int | None = None,
        obstacles: Sequence[DynamicObstacle] = (),
        start: Sequence[float] | Float = (0.0, 0.0, 0.0),
        scan_interval: float = SCAN_INTERVAL,
        scans: int | None = None,
        radius: float | None = None,
    ) -> None:
        scans = None if scans is None else whole_number(scans, "scans")
        self.world = world
        self.lrf = LaserRangeFinder() if lrf is None else lrf
        noise = ProportionalNoise(0.0) if noise is None else as_noise(noise)
        self.mapper: Mapper = line_mapper(noise) if mapper is None else mapper
        if not callable(getattr(self.mapper, "update", None)):
            raise InputError(f"mapper {self.mapper!r}: expected an object with update(scan)")
        self.rng = generator(rng)
        self.drive: Trajectory | ControlledDrive
        path = None
        if callable(getattr(drive, "command", None)):
            self.drive = ControlledDrive(drive, start, scan_interval, world, radius)  # type: ignore[arg-type]
            if self.lrf.scan_duration:
                raise InputError(
                    "scan_duration: a controller decides after a scan where the robot moves, so"
                    " that its scans take no time; set it to 0"
                )
            end = None if scans is None else scans * scan_interval
        else:
            if not isinstance(drive, Trajectory):
                poses = numbers(drive, "poses")
                drive = Trajectory(np.arange(len(np.atleast_1d(poses))), poses)
            self.drive = path = drive
            scans, end = min(scans or len(path), len(path)), float(path.times[-1])
        for obstacle in obstacles:
            expect(obstacle, DynamicObstacle, "obstacle")
        # A run stores the paths of its obstacles as poses, up to its end; an endless drive is not
        # stored.
        self.obstacles = tuple(each if end is None else each.until(end) for each in obstacles)
        self.sensor = Sensor(
            world, self.lrf, caster=caster, noise=noise, obstacles=self.obstacles, path=path
        )
        self.film: FilmPlan = USUAL_FILM
        """The default settings of the film."""
        self.radius = RADIUS if radius is None else radius
        """Radius of the robot [m]."""
        self.scans, self.done, self._seconds = scans, 0, 0.0
        self._returned: Any = None

    @property
    def map(self) -> Any:
        """The map after all scans so far, of whatever kind; None if the mapper makes none."""
        return getattr(self.mapper, "map", None) if self._returned is None else self._returned

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """The trajectory that the mapper estimates, if it does."""
        estimate = getattr(self.mapper, "estimate", None)
        return estimate if isinstance(estimate, EstimatedTrajectory) else None

    def __iter__(self) -> Iterator[Step]:
        """The remaining steps."""
        drive = self.drive
        while self.scans is None or self.done < self.scans:
            index = self.done
            if isinstance(drive, Trajectory):
                time, pose = float(drive.times[index]), drive.poses[index]
            elif drive.goes_on:
                time, pose = drive.time, np.array(drive.pose)
            else:
                return
            true_scan = self.sensor.cast(pose, time)
            self.take(scan := self.sensor.noisy(true_scan, self.rng))
            yield Step(index, time, true_scan.pose, scan, true_scan, self)

    def take(self, scan: LaserScan) -> None:
        """Take the next measured scan: map it and drive on.

        Taking recorded scans brings a new simulation to the state of an interrupted one.
        """
        begin = perf_counter()
        self._returned = self.mapper.update(scan)
        # The first update is not counted: it may compile or load the mapper.
        if self.done:
            self._seconds += perf_counter() - begin
        if isinstance(self.drive, ControlledDrive):
            self.drive.after(scan)
        self.done += 1

    @property
    def total(self) -> int:
        """The largest number of scans, which must be known to keep them."""
        if self.scans is None:
            raise InputError("scans: not given, and a controller may drive for ever; give scans=")
        return self.scans

    @property
    def milliseconds_an_update(self) -> float | None:
        """Mean time of the mapper's updates after the first [ms]; None if there are none."""
        return 1e3 * self._seconds / (self.done - 1) if self.done > 1 else None


class Runnable(Protocol):
    """Anything that can be simulated, such as a Scenario."""

    def simulation(self, **changes: Any) -> Simulation:
        """Its simulation, with the given changes."""
        ...


def simulate(
    world: World | Runnable,
    drive: Trajectory | ArrayLike | Controller | None = None,
    lrf: LaserRangeFinder | None = None,
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
        lrf: The laser range finder.
        snapshots: Largest number of map snapshots that the run keeps, for films; 100 if not given.
            With 1 only the final map is computed, which is faster.
        progress: Called with the number of finished scans, and of all.
        **settings: All others.

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
    total, row = simulation.total, row_type(simulation)
    rows: dict[str, Any] = {
        name: np.empty((total, *row[name].shape), row[name].base) for name in row.names or ()
    }
    maps = run_to_end(
        simulation, lambda step: fill_row(rows, step.index, step), progress, snapshots=snapshots
    )
    rows = {name: sealed(values)[: simulation.done] for name, values in rows.items()}
    return Run(
        simulation.world,
        simulation.lrf,
        Trajectory(rows.pop("times"), rows.pop("poses")),
        snapshot_scans=tuple(maps),
        maps=tuple(maps.values()),
        obstacles=simulation.obstacles,
        film=simulation.film,
        radius=simulation.radius,
        estimate=simulation.estimate,
        **rows,
    )


def run_to_end(
    simulation: Simulation,
    keep: Callable[[Step], None],
    progress: Progress,
    *,
    snapshots: int | None = None,
    recorded: Iterable[LaserScan] = (),
) -> dict[int, LineMap]:
    """Call ``keep`` with each step up to the last, and return the map snapshots by their scans.

    The recorded scans of an interrupted simulation are taken first.
    """
    total, maps = simulation.total, dict[int, LineMap]()
    snapshots = None if snapshots is None else whole_number(snapshots, "snapshots")

    def keep_map(always: bool = False) -> None:
        check()
        last = simulation.done - 1
        if (always or is_snapshot(last, total, snapshots)) and last not in maps:
            if isinstance(line_map := simulation.map, LineMap):
                maps[last] = line_map

    for scan in recorded:
        simulation.take(scan)
        keep_map()
    for step in simulation:
        keep(step)
        progress(simulation.done, total)
        keep_map()
    # A controller may end before all scans are done.
    keep_map(always=True)
    return maps


def row_type(simulation: Simulation) -> np.dtype[Any]:
    """What a run keeps of each scan: a field for each of the Run's attributes."""
    lrf, beams = simulation.lrf, (simulation.lrf.beams,)
    fields: list[Any] = [("times", np.float64), ("poses", np.float64, 3)]
    fields += [("ranges", np.float64, beams), ("truth", np.float64, beams)]
    fields.append(("walls", np.int64, beams))
    if simulation.world.materials:
        fields.append(("intensities", np.float64, beams))
        if lrf.echoes > 1:
            echoes = (*beams, lrf.echoes)
            fields += [("echoes", np.float64, echoes), ("echo_intensities", np.float64, echoes)]
    return np.dtype(fields)


def fill_row(rows: Mapping[str, Any], index: int, step: Step) -> None:
    """Write a step into a row of arrays with the fields of `row_type`."""
    rows["times"][index], rows["poses"][index] = step.time, step.pose
    rows["ranges"][index], rows["truth"][index] = step.scan.ranges, step.true_scan.ranges
    rows["walls"][index] = step.true_scan.walls
    for name in rows.keys() & set(LIGHT):
        # Scans of users' own parts may have no intensities.
        light = getattr(step.scan, name)
        rows[name][index] = np.nan if light is None else light


def line_mapper(noise: object, **settings: Any) -> LineMapper:
    """The default mapper: a LineMapper set up for the spread of a noise, or by settings."""
    constant, sigma = spread_of(noise) or (0.0, SIGMA)
    usual = {"sigma": sigma}
    if constant:
        usual["floor"] = float(np.hypot(FLOOR, constant))
    return LineMapper(**{**usual, **settings})
