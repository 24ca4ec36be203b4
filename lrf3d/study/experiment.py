"""An experiment: a scenario is driven, scanned and mapped, and what came out is written."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.mover import Mover, round_outline
from lrf3d.casting.timed import Caster
from lrf3d.errors import CollisionError, InputError
from lrf3d.logs.recording import run_bytes
from lrf3d.mapping import LineMapper
from lrf3d.mapping.line_mapper import FLOOR
from lrf3d.robot import Trajectory, check_drive, follow_route
from lrf3d.robot.following import CONTROL_STEP
from lrf3d.robot.free_space import Side
from lrf3d.robot.laps import chain_laps, drive_laps
from lrf3d.robot.patrol import patrol
from lrf3d.robot.planner import find_route
from lrf3d.scenario import Scenario, start_of
from lrf3d.simulation import Run, collect
from lrf3d.steps import Mapper, Simulation
from lrf3d.study.plugins import Plugin
from lrf3d.world.model import DEFAULT_HEIGHT

Progress = Callable[[int, int], None]

CASTERS: dict[str, Callable[[Any], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}

POSE_INTERVAL = 4.0
"""Time between two scans [s] where the robot stands at single poses instead of driving."""

MOST_SCANS = 10_000_000
"""Scans of a run at most, eleven days at 10 Hz: their poses are held in memory, 32 bytes each."""

CONTROLLED_SCANS = 1000
"""Scans after which a controller's drive ends where nothing is said."""

PLANNED_LOOKAHEAD = 0.4
"""How far ahead the robot steers at [m] on a route that was planned: it gets through the doors of
a house, where at 1 m it would cut their corners."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """A scenario with what is chosen for one run of it.

    Args:
        scenario: The world and how it is driven through.
        mode: Mode of the mapper; the scenario's where not given.
        sigma: Noise [m] at range_max; the scenario's first where not given.
        seed: Seed of the noise.
        caster: ``embree``, ``planar``, or a caster of the world that was used before.
        own_mapper: A mapper of the user's instead of lrf3d's.
        own_noise: A noise of the user's instead of the scenario's.
        controller: A controller of the user's that drives instead of the scenario's route.
        scans: How many scans to take: the route is driven there and back until then.
        radius: Radius [m] with which a controller's robot stands in no wall; None where it may.
    """

    scenario: Scenario
    mode: str | None = None
    sigma: float | None = None
    seed: int = 0
    caster: str | Caster = "embree"
    own_mapper: Plugin | None = None
    own_noise: Plugin | None = None
    controller: Plugin | None = None
    scans: int | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        if self.scans is not None and self.scans > MOST_SCANS:
            size = 1e-9 * run_bytes(self.scans, self.scenario.lrf.beams)
            raise InputError(
                f"scans {self.scans}: they would take {size:,.0f} GB of disk; expected at most"
                f" {MOST_SCANS:,}"
            )

    @property
    def noise(self) -> float:
        """The noise [m] that this run has."""
        return self.scenario.sigmas[0] if self.sigma is None else self.sigma

    @property
    def names(self) -> dict[str, str]:
        """The names of what is the user's own, and of the caster."""
        own = {"mapper": self.own_mapper, "noise": self.own_noise, "controller": self.controller}
        return {
            "caster": self.caster if isinstance(self.caster, str) else type(self.caster).__name__,
            **{kind: plugin.name for kind, plugin in own.items() if plugin is not None},
        }

    def mapper(self) -> Mapper:
        """A new mapper: the user's own, or lrf3d's."""
        return self.line_mapper() if self.own_mapper is None else self.own_mapper.make()

    def line_mapper(self) -> LineMapper:
        """A new LineMapper, with the scenario's thresholds and the noise of this run."""
        constant = self.scenario.imperfections.constant
        settings = {"sigma": self.noise, **self.scenario.mapper}
        if constant:
            settings.setdefault("floor", float(np.hypot(FLOOR, constant)))
        if self.mode is not None:
            settings["mode"] = self.mode
        return LineMapper(**settings)

    def movers(self, until: float) -> tuple[Mover, ...]:
        """What moves beside the robot, on its way there and back up to a time [s]."""
        return tuple(
            Mover(
                table.get("points", round_outline(table.get("radius", self.scenario.radius))),
                patrol(table["route"], speed=table.get("speed", 1.0), until=until),
                table.get("height", DEFAULT_HEIGHT),
            )
            for table in self.scenario.movers
        )

    def simulation(self, trajectory: Trajectory | None) -> Simulation:
        """The simulation along a trajectory, or with the controller where there is none."""
        scenario, settings = self.scenario, {}
        drive: Any = trajectory
        if trajectory is None:
            assert self.controller is not None
            drive = self.controller.make()
            settings = {
                "start": _start(scenario),
                "scan_interval": scenario.scan_interval,
                "scans": CONTROLLED_SCANS if self.scans is None else self.scans,
                "radius": self.radius,
            }
            until = settings["scans"] * scenario.scan_interval
        else:
            until = float(trajectory.times[-1])
        noise = scenario.imperfections.noise(self.noise)
        return Simulation(
            scenario.world,
            drive,
            scenario.lrf,
            caster=self._caster(),
            noise=noise if self.own_noise is None else self.own_noise.make(),
            mapper=self.mapper(),
            rng=self.seed,
            movers=self.movers(until),
            **settings,
        )

    def simulate(
        self, trajectory: Trajectory | None, progress: Progress = lambda d, t: None
    ) -> Run:
        """Run the simulation to its end, all of it in memory."""
        return collect(self.simulation(trajectory), progress)

    def _caster(self) -> Caster:
        """What casts the beams; one that was used before has its trees already."""
        if not isinstance(self.caster, str):
            return self.caster
        if self.caster not in CASTERS:
            raise InputError(f"caster {self.caster!r}: expected one of {', '.join(CASTERS)}")
        return CASTERS[self.caster](self.scenario.world)


def _start(scenario: Scenario) -> Any:
    """Where a controller's drive begins."""
    if scenario.start is not None:
        return scenario.start
    return scenario.poses[0] if scenario.poses is not None else (0.0, 0.0, 0.0)


def with_route(scenario: Scenario, *, where: Side | None = None) -> Scenario:
    """The scenario, with a route that sees most of its walls where its file names none.

    Args:
        scenario: The scenario; a start that it names is where the route begins.
        where: The side of the walls to stay on; by the world and the start where not given.

    Raises:
        InputError: There is no free space to drive in.
    """
    if scenario.poses is not None or scenario.route is not None:
        return scenario
    lookahead = min(scenario.lookahead, PLANNED_LOOKAHEAD)
    found = find_route(
        scenario.world,
        radius=scenario.radius,
        range_max=scenario.lrf.range_max,
        lookahead=lookahead,
        where=where,
        start=scenario.start,
    )
    start = start_of(found.waypoints) if scenario.start is None else scenario.start
    return replace(
        scenario, route=found.waypoints, start=start, lookahead=lookahead, planned=found.side
    )


def trajectory_of(
    scenario: Scenario,
    *,
    scans: int | None = None,
    ignore_collisions: Callable[[str], None] | None = None,
) -> Trajectory:
    """The drive of a scenario along its route, or the stand at each of its poses.

    Args:
        scenario: The scenario.
        scans: Drive there and back, or stand at the poses again, until so many scans are taken;
            once along the route where not given.
        ignore_collisions: Where given, it is called with the message of a drive that would run
            into a wall, and the drive goes on.

    Raises:
        CollisionError: The drive would run into a wall.
        InputError: The scenario has neither poses nor a route, or the drive is too long.
    """
    if scans is not None and scans > MOST_SCANS:
        raise InputError(f"{scans:,} scans: more than {MOST_SCANS:,}; ask for fewer")
    if scenario.poses is not None:
        stops = np.arange(len(scenario.poses) if scans is None else scans)
        return Trajectory(POSE_INTERVAL * stops, scenario.poses[stops % len(scenario.poses)])
    if scenario.route is None:
        raise InputError(f"{scenario.name}: neither poses nor a route to drive")
    # The robot is steered, and must keep clear of walls, between its scans as well.
    commands = max(1, round(scenario.scan_interval / CONTROL_STEP))
    how: dict[str, Any] = {
        "speed": scenario.speed,
        "lookahead": scenario.lookahead,
        "dt": scenario.scan_interval / commands,
    }
    if scans is None:
        laps: tuple[Trajectory, ...] = (follow_route(scenario.route, start=scenario.start, **how),)
    else:
        most = (scans - 1) * commands + 1
        laps = drive_laps(scenario.route, start=scenario.start, most=most, **how)
    try:
        for lap in laps:
            check_drive(lap, scenario.world, scenario.radius)
    except CollisionError as error:
        if ignore_collisions is None:
            raise
        ignore_collisions(str(error))
    laps = tuple(lap.every(commands) for lap in laps)
    return laps[0] if scans is None else chain_laps(laps, scans)
