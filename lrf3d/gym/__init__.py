"""Environments of Gymnasium in which robots drive to goals: one, or a thousand at once.

``import lrf3d.gym`` registers ``lrf3d/Drive-v0``; then ``gymnasium.make("lrf3d/Drive-v0")`` gives a
:class:`DriveEnv`, and ``gymnasium.make_vec("lrf3d/Drive-v0", num_envs=1024)`` a
:class:`DriveVectorEnv`, whose robots' beams are cast together.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError, missing_extra, shown
from lrf3d.casting import PlanarCaster
from lrf3d.casting.collision import Body, CollisionChecker, robots_among
from lrf3d.casting.crowd import moves_of
from lrf3d.geometry.lines import Float, Int, is_finite, numbers, sealed, whole_number, wrap_angle
from lrf3d.geometry.pose import Pose, as_pose
from lrf3d.laser import LaserScan, Noise, ProportionalNoise
from lrf3d.laser.noise import at_sigma
from lrf3d.laser.scan import ScanBatch
from lrf3d.planning.free_space import free_places
from lrf3d.robot import Trajectory
from lrf3d.robot.following import MAX_TURN_RATE
from lrf3d.simulation.driven import hold_all
from lrf3d.simulation.run import Run
from lrf3d.simulation.scenario import Scenario, load_scenario
from lrf3d.simulation.sensor import Sensor
from lrf3d.studio.render.window import Window

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space

    from lrf3d.gym.clouds import CloudObserver
except ModuleNotFoundError:
    raise missing_extra("environments need Gymnasium", "gym") from None

# The identifier of the environment in Gymnasium.
ID = "lrf3d/Drive-v0"

# Default number of steps after which an episode is truncated.
MAX_STEPS = 500

# Least distance of a goal from the start [m] in a world large enough: some seconds of driving.
GOAL_NEAR = 5.0

# Largest distance of a goal from the start [m] in a world large enough: it fits into MAX_STEPS.
GOAL_FAR = 20.0

# Distance from the goal [m] at which a robot has arrived.
GOAL_RADIUS = 0.5

# Reward at the goal [m of driving].
GOAL_REWARD = 10.0

# Reward at a wall [m of driving]: it takes back a goal.
WALL_REWARD = -GOAL_REWARD

# Reward of each step [m of driving], so that fast drives score higher.
STEP_REWARD = -0.01

# Clearance of a robot from walls at its start, in addition to its radius [m].
GOAL_MARGIN = 0.1

Observation = dict[str, NDArray[np.float32]]
Array = NDArray[Any]


class _Limited:
    """An environment that truncates episodes itself, and declares so in its specification."""

    max_steps: int
    _spec: Any = None

    @property
    def spec(self) -> Any:
        """The specification from which Gymnasium made it."""
        return self._spec

    @spec.setter
    def spec(self, spec: Any) -> None:
        # If steps were registered, Gymnasium would truncate episodes a second time.
        self._spec = spec and replace(spec, max_episode_steps=self.max_steps)


class DriveVectorEnv(_Limited, VectorEnv[Observation, Array, Array]):
    """Robots that each drive to a goal, as in DriveEnv, in one world.

    A robot whose episode has ended is placed again in the next step, which ignores its action
    (autoreset ``NEXT_STEP``); or in the same step, with its last observation in
    ``infos["final_obs"]`` (``SAME_STEP``); or it rests until it is reset (``DISABLED``). ``poses``
    (k, 3) and ``goals`` (k, 2) are the current ones.

    Args:
        num_envs: Number of robots.
        world: A built-in world or a world file, or a Scenario.
        sigma: Noise of the ranges [m] at range_max; the noise of the scenario if not given.
        max_steps: Steps after which an episode is truncated.
        together: Whether the robots see and touch each other, and meet the dynamic obstacles at the
            same time; otherwise each is alone with them.
        autoreset: When a robot whose episode has ended is placed again, an AutoresetMode.
        render_mode: None; only DriveEnv draws pictures.

    Raises:
        InputError: An argument is invalid, or there is no free space to drive in.
        WorldError: There is no such world.
    """

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        world: str | Path | Scenario = "city",
        *,
        sigma: float | None = None,
        max_steps: int = MAX_STEPS,
        together: bool = False,
        autoreset: AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        num_envs = whole_number(num_envs, "num_envs")
        max_steps = whole_number(max_steps, "max_steps")
        if render_mode is not None:
            raise InputError(
                f"render_mode {render_mode!r}: not available for many robots; use DriveEnv"
            )
        self.scenario = scenario = world if isinstance(world, Scenario) else load_scenario(world)
        if scenario.attitude is not None:
            raise InputError("drive: pitch and roll are not simulated in environments")
        self.autoreset = AutoresetMode(autoreset)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset}
        self.num_envs = num_envs
        self.max_steps = max_steps
        self.lrf = scenario.lrf
        self.lasers = scenario.lasers
        self.dt = scenario.scan_interval
        self.together = bool(together)
        # A scan takes no time, because the robot decides on its motion after it.
        self._caster = PlanarCaster(scenario.world)
        self._body = body = Body(scenario.radius, scenario.outline)
        paths = [Trajectory([0.0], np.zeros((1, 3)))] * (num_envs if together else 0)
        _, self._crowd = robots_among(body, paths, scenario.obstacles)
        self._own = np.arange(num_envs) if together else np.full(num_envs, -1)
        self._sensors = [
            Sensor(scenario.world, each, caster=self._caster, noise=noise, obstacles=self._crowd)
            for each, noise in zip(self.lasers, _noises(scenario, sigma), strict=True)
        ]
        self._checker = CollisionChecker(scenario.world, self._crowd)
        self._cells = free_places(scenario.world, scenario.radius + GOAL_MARGIN)
        self._farthest = float(np.hypot(*np.ptp(self._cells, axis=0))) + GOAL_FAR
        low, high = np.array([[0.0, -1.0, -1.0], [self._farthest, 1.0, 1.0]], np.float32)
        beams = [each.beams for each in self.lasers]
        self._reach = np.repeat([np.float32(each.range_max) for each in self.lasers], beams)
        seen = spaces.Box(np.zeros_like(self._reach), self._reach)
        self._cloud_observer = CloudObserver(
            scenario, self._caster, _noises(scenario, sigma)[0], self._crowd
        )
        self.single_observation_space = spaces.Dict(
            {"goal": spaces.Box(low, high), "ranges": seen, **self._cloud_observer.spaces}
        )
        self.single_action_space = spaces.Box(np.float32(-1.0), np.float32(1.0), (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.poses = np.zeros((num_envs, 3))
        self.goals = np.zeros((num_envs, 2))
        self._times = np.zeros(num_envs)
        self._steps = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)

    def reset(
        self,
        *,
        seed: int | Sequence[int] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Place robots at random, or at the ``pose`` (3,) and the ``goal`` (2,) in options.

        All are placed, or those of a ``reset_mask`` (num_envs,) in options. The same seed gives the
        same episodes, and so does the same sequence of one for each robot.

        Raises:
            InputError: One of the options is not finite numbers of its shape.
        """
        if isinstance(seed, Sequence):
            if len(seed) != self.num_envs:
                raise InputError(f"{len(seed)} seeds: expected one for each of {self.num_envs}")
            self.np_random = np.random.default_rng([*seed])
        else:
            super().reset(seed=seed)
        options = options or {}
        mask = np.asarray(options.get("reset_mask", np.ones(self.num_envs, np.bool_)))
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise InputError(f"reset_mask {shown(mask)}: expected {self.num_envs} booleans")
        robots = np.flatnonzero(mask)
        self._place(robots)
        if "pose" in options:
            self.poses[robots] = as_pose(options["pose"])
        if "goal" in options:
            goal = numbers(options["goal"], "goal")
            if goal.shape != (2,) or not is_finite(*goal):
                raise InputError(f"goal {shown(options['goal'])}: expected x, y [m]")
            self.goals[robots] = goal
        self._ended[robots] = False
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, dict[str, Any]]:
        """Drive with actions (num_envs, 2) for the time between two scans.

        A robot that touches a wall or a dynamic obstacle rests there, as `Driven` does, and the
        distance to it is not rewarded.
        """
        given = numbers(actions, "actions")
        again = self._ended
        if given.shape != (self.num_envs, 2):
            raise InputError(f"actions of shape {given.shape}: expected {(self.num_envs, 2)}")
        given = np.where(again[:, None], 0.0, given)
        if not (finite := np.isfinite(given).all(axis=1)).all():
            found = f"action of robot {(robot := int(np.argmin(finite)))}: {given[robot].tolist()}"
            raise InputError(f"{found}; expected finite numbers from -1 to 1")
        before = self.distances()
        # Actions are shares of the scenario's speed and of the fastest turn, left positive.
        v, omega = (np.clip(given, -1.0, 1.0) * (self.scenario.speed, MAX_TURN_RATE)).T
        seconds = np.full(self.num_envs, self.dt)
        twists = np.column_stack([v, np.zeros(self.num_envs), omega])
        moves = moves_of(self._times, self.poses, twists)
        if self.together:
            self._crowd.hold(moves)
        self.poses, touched = hold_all(self._checker, self._body, moves, seconds, self._own)
        self.poses[:, 2] = wrap_angle(self.poses[:, 2])
        self._times += self.dt
        collided = touched & ~again
        after = self.distances()
        reached = (after < GOAL_RADIUS) & ~collided & ~again
        nearer = np.where(collided, 0.0, before - after)
        rewards = nearer + STEP_REWARD + GOAL_REWARD * reached + WALL_REWARD * collided
        self._steps += 1
        ended = reached | collided
        cut = (self._steps >= self.max_steps) & ~ended & ~again
        self._ended = ended | cut
        if self.autoreset is AutoresetMode.DISABLED:
            self._ended |= again
        else:
            self._place(np.flatnonzero(again))
        # Gymnasium's vector infos mark by a second array which environments have a value.
        valid = np.ones(self.num_envs, np.bool_)
        infos: dict[str, Any] = {
            "reached": reached, "_reached": valid, "collided": collided, "_collided": valid,
        }  # fmt: skip
        if self.autoreset is AutoresetMode.SAME_STEP and self._ended.any():
            infos = {**infos, "final_info": infos, "_final_info": self._ended}
            infos |= {"final_obs": self._observe(), "_final_obs": self._ended}
            self._place(np.flatnonzero(self._ended))
            self._ended = np.zeros(self.num_envs, np.bool_)
        return self._observe(), np.where(again, 0.0, rewards), ended, cut, infos

    def distances(self) -> Float:
        """Distances (k,) of the robots from their goals [m]."""
        away = self.goals - self.poses[:, :2]
        return np.hypot(away[:, 0], away[:, 1])

    def _place(self, robots: Int) -> None:
        rng = self.np_random
        # Number of random candidates for a goal, of which the first at such a distance is used.
        candidates = 32
        cells = self._cells[rng.integers(len(self._cells), size=(len(robots), candidates + 1))]
        starts = cells[:, 0]
        goals = cells[:, 1:]
        if self.together:
            starts = self._apart(robots, starts, goals)
        distances = np.hypot(*np.moveaxis(goals - starts[:, None], 2, 0))
        # Distance of each candidate from the limits; argmin takes the first of those within them.
        misfit = np.maximum(GOAL_NEAR - distances, distances - GOAL_FAR).clip(min=0.0)
        self.goals[robots] = goals[np.arange(len(robots)), misfit.argmin(axis=1)]
        headings = rng.uniform(-np.pi, np.pi, len(robots))
        self.poses[robots] = np.column_stack([starts, headings])
        self._steps[robots] = 0
        if not self.together:
            self._times[robots] = 0.0

    def _apart(self, robots: Int, starts: Float, others: Float) -> Float:
        """Starts (k, 2) of robots, or others of (k, n, 2), away from where other robots are."""
        room = 2.0 * self._body.reach + GOAL_MARGIN
        places = self.poses.T[:2].copy()
        places[:, robots] = np.inf

        def away(choice: Float) -> float:
            offsets = places - choice[:, None]
            return float((offsets * offsets).sum(axis=0).min())

        for robot, choices in zip(
            robots, np.concatenate([starts[:, None], others], 1), strict=True
        ):
            # The first with room; nearly always one of the first.
            best = next((each for each in choices if away(each) >= room * room), None)
            places[:, robot] = max(choices, key=away) if best is None else best
        return places[:, robots].T

    def _scan(self) -> tuple[Float, Float, Int]:
        """Measured and true ranges, and walls, (k, beams) each, after REP 117, laser by laser."""
        if self.together:
            self._crowd.hold(moves_of(self._times, self.poses))
        parts = [self._scan_of(sensor) for sensor in self._sensors]
        if len(parts) == 1:
            return parts[0]
        measured, truth, walls = map(np.hstack, zip(*parts, strict=True))
        return measured, truth, walls

    def _scan_of(self, sensor: Sensor) -> tuple[Float, Float, Int]:
        lrf = sensor.lrf
        poses = sensor.lrf.placed(self.poses)
        if self.scenario.world.materials:
            # Intensities are of single scans.
            places = zip(self._own.tolist(), self.poses, self._times.tolist(), strict=True)
            scans = [sensor.without(own).cast(pose, time) for own, pose, time in places]
            batch = ScanBatch.of(scans)
        else:
            truth, walls = self._caster.scan_batch(lrf, poses)
            for time in np.unique(self._times) if len(self._crowd) else ():
                now = slice(None) if self.together else np.flatnonzero(self._times == time)
                ranges = truth[now]
                met = walls[now]
                self._crowd.stop_scans(lrf, poses[now], time, ranges, met, self._own[now])
                truth[now] = ranges
                walls[now] = met
            # Noises that take single scans get rows of them, without copies.
            batch = ScanBatch(
                lrf.angles, sealed(truth), sealed(walls), lrf.range_min, lrf.range_max
            )
            scans = []
        measured = sensor.noisy_ranges(batch, self.np_random)
        if measured is None:
            scans = scans or [
                LaserScan.unchecked(lrf, Pose(*pose), *row, time=time)
                for pose, time, *row in zip(
                    poses.tolist(), self._times.tolist(), truth, walls, strict=True
                )
            ]
            measured = np.array([sensor.noisy(scan, self.np_random).ranges for scan in scans])
        return measured, batch.ranges, batch.walls

    def _observe(self) -> Observation:
        """The observations of the robots, in finite float32 numbers.

        A beam without return has range_max, one below range_min has 0: the limits of what can be
        measured.
        """
        # Measured and true ranges, and walls, of the last step.
        self.scan = self._scan()
        away = self.goals - self.poses[:, :2]
        distances = self.distances()
        bearings = np.arctan2(away[:, 1], away[:, 0]) - self.poses[:, 2]
        near = np.minimum(distances, self._farthest)
        goal = np.column_stack([near, np.cos(bearings), np.sin(bearings)])
        ranges = np.clip(self.scan[0], 0.0, self._reach)
        clouds = self._cloud_observer.observe(self.poses, self._times, self._own, self.np_random)
        return {"goal": goal.astype(np.float32), "ranges": ranges.astype(np.float32), **clouds}


class DriveEnv(_Limited, gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot that drives to a goal by its range finder, without hitting a wall.

    The observation is ``ranges`` (beams,) [m] in float32, range_max without return and 0 below
    range_min, and ``goal`` (3,): distance [m], cosine and sine of the bearing; in a world with a
    lidar or a depth camera also ``lidar`` (layers, columns) and ``depth`` (height, width) [m]. The
    action is v and ω, from −1 to 1 of the scenario's speed and of 1.5 rad/s, held until the next
    scan. The reward is 1 for each metre nearer to the goal, 10 at the goal, −10 at a wall, and
    −0.01 for each step. An episode ends at the goal or at a wall, and is truncated after max_steps.

    Args:
        world: A built-in world, a world file or a Scenario, with the range finder, the robot's
            radius and speed, and the time between two steps.
        sigma: Noise of the ranges [m] at range_max; the noise of the scenario if not given.
        max_steps: Steps after which an episode is truncated.
        render_mode: ``rgb_array`` for pictures by `render`, ``human`` for a window that shows each
            step, or None.
        size: Width and height of the pictures [pixels].
        view: Their camera: ``chase``, ``first``, ``orbit`` or ``top``.

    Raises:
        InputError: An argument is invalid.
        WorldError: There is no such world.
        MissingLibraryError: No window can be opened.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 5}  # noqa: RUF012

    def __init__(
        self,
        world: str | Path | Scenario = "city",
        *,
        sigma: float | None = None,
        max_steps: int = MAX_STEPS,
        render_mode: str | None = None,
        size: tuple[int, int] = (640, 360),
        view: str = "chase",
    ) -> None:
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode {render_mode!r}: expected 'human', 'rgb_array' or None")
        # The vector environment with one robot.
        self.robots = DriveVectorEnv(1, world, sigma=sigma, max_steps=max_steps)
        self.max_steps = self.robots.max_steps
        self.observation_space = self.robots.single_observation_space
        self.action_space = self.robots.single_action_space
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.robots.dt))}
        self._size = size
        self._view = view
        self._window = Window("lrf3d") if render_mode == "human" else None
        self._film: list[tuple[Float, ...]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place the robot and its goal, as `DriveVectorEnv.reset` does."""
        super().reset(seed=seed)
        self.robots.np_random = self.np_random
        observation, _ = self.robots.reset(options=options)
        self._film = []
        return self._shown(observation), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive with an action (2,)."""
        given = numbers(action, "action")
        if given.shape != (2,):
            raise InputError(f"action of shape {given.shape}: expected (2,), speed and turn rate")
        observation, rewards, ended, cut, infos = self.robots.step(given[None])
        info = self._info() | {name: bool(infos[name][0]) for name in ("reached", "collided")}
        return self._shown(observation), float(rewards[0]), bool(ended[0]), bool(cut[0]), info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (h, w, 3) uint8 of the current state, as in a film, with the goal.

        None without a render_mode, and with ``human``, where the window shows it.
        """
        return self._picture() if self.render_mode == "rgb_array" and self._film else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _shown(self, observation: Observation) -> Observation:
        """The observation of the robot; it is kept for pictures, and shown in the window."""
        if self.render_mode is not None:
            self._film.append((self.robots.poses[0], *(rows[0] for rows in self.robots.scan)))
        if self._window is not None:
            self._window.show(self._picture(), self.robots.dt)
        return {name: value[0] for name, value in observation.items()}

    def _picture(self) -> NDArray[np.uint8]:
        from lrf3d.studio.render.film import frame

        poses, ranges, truth, walls = (np.array(column) for column in zip(*self._film, strict=True))
        times = self.robots.dt * np.arange(len(poses))
        scenario = self.robots.scenario
        obstacles = tuple(obstacle.until(times[-1]) for obstacle in scenario.obstacles)
        path = Trajectory(times, poses)
        drawn = scenario.world, scenario.lrf, path, ranges, truth, walls, (), (), obstacles
        run = Run(*drawn, radius=scenario.radius, further=scenario.lasers[1:])
        goal = (*self.robots.goals[0].tolist(), GOAL_RADIUS)
        return frame(run, float(times[-1]), size=self._size, view=self._view, goal=goal)

    def _info(self) -> dict[str, Any]:
        return {"pose": self.robots.poses[0].copy(), "goal": self.robots.goals[0].copy()}


def _noises(scenario: Scenario, sigma: float | None) -> list[Noise]:
    """The noise of each laser, at a standard deviation [m] if it is given."""
    noises = [scenario.noise, *(noise for _, noise in scenario.further)]
    if sigma is None:
        return noises
    return [at_sigma(each, sigma) if sigma else ProportionalNoise(0.0) for each in noises]


if ID not in gymnasium.registry:
    gymnasium.register(
        ID,
        entry_point="lrf3d.gym:DriveEnv",
        vector_entry_point="lrf3d.gym:DriveVectorEnv",
    )
