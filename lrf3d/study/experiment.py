"""An experiment: a scenario is driven, scanned and mapped, and what came out is written."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lrf3d.casting import EmbreeCaster, PlanarCaster
from lrf3d.casting.mover import Mover, round_outline
from lrf3d.casting.timed import Caster
from lrf3d.errors import CollisionError, InputError
from lrf3d.mapping import LineMapper
from lrf3d.mapping.line_mapper import FLOOR
from lrf3d.robot import Trajectory, check_drive, follow_route
from lrf3d.robot.patrol import patrol
from lrf3d.robot.planner import plan_route
from lrf3d.scenario import Scenario, start_of
from lrf3d.simulation import Run, simulate
from lrf3d.world.model import DEFAULT_HEIGHT

Progress = Callable[[int, int], None]

CASTERS: dict[str, Callable[[Any], Caster]] = {"embree": EmbreeCaster, "planar": PlanarCaster}

POSE_INTERVAL = 4.0
"""Time between two scans [s] where the robot stands at single poses instead of driving."""

LOOKAHEAD = 1.0
"""How far ahead on the route the robot steers at [m]: about three of its radii, so that it cuts
corners by no more than the clearance that routes keep."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """A scenario with what is chosen for one run of it.

    Args:
        scenario: The world and how it is driven through.
        mode: Mode of the mapper; the scenario's where not given.
        sigma: Noise [m] at range_max; the scenario's first where not given.
        seed: Seed of the noise.
        caster: ``embree``, ``planar``, or a caster of the world that was used before.
    """

    scenario: Scenario
    mode: str | None = None
    sigma: float | None = None
    seed: int = 0
    caster: str | Caster = "embree"

    @property
    def noise(self) -> float:
        """The noise [m] that this run has."""
        return self.scenario.sigmas[0] if self.sigma is None else self.sigma

    def mapper(self) -> LineMapper:
        """A new mapper, with the scenario's thresholds and the noise of this run."""
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

    def simulate(self, trajectory: Trajectory, progress: Progress = lambda d, t: None) -> Run:
        """Run the simulation along a trajectory."""
        return simulate(
            self.scenario.world,
            trajectory,
            self.scenario.lrf,
            caster=self._caster(),
            noise=self.scenario.imperfections.noise(self.noise),
            mapper=self.mapper(),
            rng=self.seed,
            movers=self.movers(float(trajectory.times[-1])),
            progress=progress,
        )

    def _caster(self) -> Caster:
        """What casts the beams; one that was used before has its trees already."""
        if not isinstance(self.caster, str):
            return self.caster
        if self.caster not in CASTERS:
            raise InputError(f"caster {self.caster!r}: expected one of {', '.join(CASTERS)}")
        return CASTERS[self.caster](self.scenario.world)


def with_route(scenario: Scenario) -> Scenario:
    """The scenario, with a route that sees most of its walls where its file names none.

    Raises:
        InputError: There is no free space to drive in.
    """
    if scenario.poses is not None or scenario.route is not None:
        return scenario
    route = plan_route(scenario.world, radius=scenario.radius, range_max=scenario.lrf.range_max)
    return replace(scenario, route=route, start=start_of(route))


def trajectory_of(
    scenario: Scenario, *, ignore_collisions: Callable[[str], None] | None = None
) -> Trajectory:
    """The drive of a scenario along its route, or the stand at each of its poses.

    Args:
        scenario: The scenario.
        ignore_collisions: Where given, it is called with the message of a drive that would run
            into a wall, and the drive goes on.

    Raises:
        CollisionError: The drive would run into a wall.
        InputError: The scenario has neither poses nor a route.
    """
    if scenario.poses is not None:
        return Trajectory(POSE_INTERVAL * np.arange(len(scenario.poses)), scenario.poses)
    if scenario.route is None:
        raise InputError(f"{scenario.name}: neither poses nor a route to drive")
    trajectory = follow_route(
        scenario.route,
        start=scenario.start,
        speed=scenario.speed,
        lookahead=LOOKAHEAD,
        dt=scenario.scan_interval,
    )
    try:
        check_drive(trajectory, scenario.world, scenario.radius)
    except CollisionError as error:
        if ignore_collisions is None:
            raise
        ignore_collisions(str(error))
    return trajectory


def noise_levels(
    experiment: Experiment, trajectory: Trajectory, sigmas: tuple[float, ...], progress: Progress
) -> list[Run]:
    """Runs of one experiment at several noises [m], each with the same seed."""
    return [replace(experiment, sigma=sigma).simulate(trajectory, progress) for sigma in sigmas]
