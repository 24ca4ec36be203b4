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
from lrf3d.laser.noise import FLOOR, SIGMA, Noise, noises_of, spread_of
from lrf3d.laser.range_finder import lasers_of
from lrf3d.laser.scan import LIGHT
from lrf3d.mapping import LineMap, LineMapper
from lrf3d.pose import Pose, as_pose
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.robot.unicycle import RADIUS
from lrf3d.run import Run, is_snapshot
from lrf3d.sensor import Caster, Sensor, caster_of
from lrf3d.steering import ControlledDrive, Controller
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan


class Mapper(Protocol):
    """Anything that builds a map from scans.

    The map after a scan is the mapper's attribute ``map``, a LineMap or anything else. A mapper
    without it returns the map from `update`. A mapper that estimates the poses may have the
    attribute ``estimate``, an EstimatedTrajectory, which pictures and films show next to the truth.
    It gets the scans of several lasers one by one, or, if its attribute ``several`` is true, those
    of a moment as a tuple.
    """

    def update(self, scan: LaserScan) -> Any:
        """Add a scan; a return value other than None is the map."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One step of a simulation: the measured scans and the true ones, and the map after them.

    There is a scan for each laser. The ``index`` counts from 0; the ``time`` [s] is that of the
    first beams, and the ``pose`` that of the robot then.

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
    scans: tuple[LaserScan, ...]
    true_scans: tuple[LaserScan, ...]
    _simulation: "Simulation" = field(repr=False)

    @property
    def scan(self) -> LaserScan:
        """The measured scan of the first laser."""
        return self.scans[0]

    @property
    def true_scan(self) -> LaserScan:
        """The true scan of the first laser."""
        return self.true_scans[0]

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
    """A robot with one or several laser range finders that drives through a world, step by step.

    Each iteration of ``for step in simulation`` scans, maps and drives on. The loop may be left and
    continued at any time. Earlier steps are not kept, so a simulation can run forever.

    Args:
        world: The walls.
        drive: A Trajectory, poses (k, 3) a second apart, or a controller: anything with
            ``command(time, pose, scan) -> (v, w)``, speed [m/s] and turn rate [rad/s] up to the
            next scan, or None to end the drive. With several lasers it gets a tuple of their scans.
        lrf: The laser range finder, or several; 181 beams over 180° up to 80 m if not given.
        caster: Casts the beams: ``embree``, ``planar``, or an object with ``cast``.
        noise: Turns true scans into measured ones, ``noise(scan, rng)``, or one for each laser;
            none if not given.
        mapper: Builds the map, anything with ``update(scan)``, which is called for each laser; a
            LineMapper set up for the noise if not given.
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
        lrf: LaserRangeFinder | Sequence[LaserRangeFinder] | None = None,
        *,
        caster: Caster | str = "embree",
        noise: Noise | Sequence[Noise] | None = None,
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
        self.lasers = lasers_of(LaserRangeFinder() if lrf is None else lrf)
        noises = noises_of(ProportionalNoise(0.0) if noise is None else noise, self.lasers)
        self.mapper: Mapper = line_mapper(noises[0]) if mapper is None else mapper
        if not callable(getattr(self.mapper, "update", None)):
            raise InputError(f"mapper {self.mapper!r}: expected an object with update(scan)")
        self.rng = generator(rng)
        self.drive: Trajectory | ControlledDrive
        path = None
        if callable(getattr(drive, "command", None)):
            self.drive = ControlledDrive(drive, start, scan_interval, world, radius)  # type: ignore[arg-type]
            if any(each.scan_duration for each in self.lasers):
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
        shared = caster_of(caster, world)
        self.sensors = tuple(
            Sensor(world, each, caster=shared, noise=own, obstacles=self.obstacles, path=path)
            for each, own in zip(self.lasers, noises, strict=True)
        )
        self.film: FilmPlan = USUAL_FILM
        """The default settings of the film."""
        self.radius = RADIUS if radius is None else radius
        """Radius of the robot [m]."""
        self.scans, self.done, self._seconds = scans, 0, 0.0
        self._returned: Any = None

    @property
    def lrf(self) -> LaserRangeFinder:
        """The first laser."""
        return self.lasers[0]

    @property
    def sensor(self) -> Sensor:
        """The first laser among the walls, with its noise."""
        return self.sensors[0]

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
            truth = tuple(sensor.cast(pose, time) for sensor in self.sensors)
            scans = tuple(
                sensor.noisy(scan, self.rng)
                for sensor, scan in zip(self.sensors, truth, strict=True)
            )
            self.take(scans)
            yield Step(index, time, as_pose(pose), scans, truth, self)

    def take(self, scans: Sequence[LaserScan]) -> None:
        """Take the next measured scan of each laser: map them and drive on.

        Taking recorded scans brings a new simulation to the state of an interrupted one.
        """
        begin = perf_counter()
        self._returned = update_mapper(self.mapper, scans)
        # The first update is not counted: it may compile or load the mapper.
        if self.done:
            self._seconds += perf_counter() - begin
        if isinstance(self.drive, ControlledDrive):
            self.drive.after(scans[0] if len(scans) == 1 else scans)
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
        further=simulation.lasers[1:],
        **rows,
    )


def run_to_end(
    simulation: Simulation,
    keep: Callable[[Step], None],
    progress: Progress,
    *,
    snapshots: int | None = None,
    recorded: Iterable[Sequence[LaserScan]] = (),
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

    for scans in recorded:
        simulation.take(scans)
        keep_map()
    for step in simulation:
        keep(step)
        progress(simulation.done, total)
        keep_map()
    # A controller may end before all scans are done.
    keep_map(always=True)
    return maps


def update_mapper(mapper: Any, scans: Sequence[LaserScan]) -> Any:
    """Update a mapper by the scans of a moment: one by one, or all at once where it takes several.

    It returns what the mapper does.
    """
    if len(scans) > 1 and getattr(mapper, "several", False):
        return mapper.update(tuple(scans))
    returned = None
    for scan in scans:
        returned = mapper.update(scan)
    return returned


def row_type(simulation: Simulation) -> np.dtype[Any]:
    """What a run keeps of each scan: a field for each of the Run's attributes."""
    lasers = simulation.lasers
    beams, echoes = (sum(each.beams for each in lasers),), lasers[0].echoes
    fields: list[Any] = [("times", np.float64), ("poses", np.float64, 3)]
    fields += [("ranges", np.float64, beams), ("truth", np.float64, beams)]
    fields.append(("walls", np.int64, beams))
    if simulation.world.materials:
        fields.append(("intensities", np.float64, beams))
        if echoes > 1:
            each_echo = (*beams, echoes)
            fields += [(name, np.float64, each_echo) for name in ("echoes", "echo_intensities")]
    if any(each.scan_duration for each in lasers):
        fields.append(("motions", np.float64, (len(lasers), 3)))
    return np.dtype(fields)


def fill_row(rows: Mapping[str, Any], index: int, step: Step) -> None:
    """Write a step into a row of arrays with the fields of `row_type`, laser beside laser."""
    rows["times"][index], rows["poses"][index] = step.time, step.pose
    begin = 0
    for number, (scan, truth) in enumerate(zip(step.scans, step.true_scans, strict=True)):
        beams = slice(begin, begin := begin + len(scan.ranges))
        rows["ranges"][index, beams], rows["truth"][index, beams] = scan.ranges, truth.ranges
        rows["walls"][index, beams] = truth.walls
        if "motions" in rows:
            rows["motions"][index, number] = 0.0 if truth.motion is None else truth.motion
        for name in rows.keys() & set(LIGHT):
            # Scans of users' own parts may have no intensities.
            light = getattr(scan, name)
            rows[name][index, beams] = np.nan if light is None else light


def line_mapper(noise: object, **settings: Any) -> LineMapper:
    """The default mapper: a LineMapper set up for the spread of a noise, or by settings."""
    constant, sigma = spread_of(noise) or (0.0, SIGMA)
    usual = {"sigma": sigma}
    if constant:
        usual["floor"] = float(np.hypot(FLOOR, constant))
    return LineMapper(**{**usual, **settings})
