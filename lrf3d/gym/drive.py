"""Environments of Gymnasium for a DriveTask: many robots at once, and one with pictures."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, numbers
from lrf3d.gym.task import GOAL_RADIUS, DriveTask
from lrf3d.pose import as_pose
from lrf3d.render.window import Window
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scenario import Scenario, load_scenario

MAX_STEPS = 500
"""Default number of steps after which an episode is truncated."""

Observation = dict[str, NDArray[np.float32]]
Array = NDArray[Any]


class DriveVectorEnv(VectorEnv[Observation, Array, Array]):
    """Robots that each drive to a goal, as in DriveEnv, in one world without seeing each other.

    A robot whose episode has ended is placed again in the step after (autoreset ``NextStep``);
    its action in that step is ignored.

    Args:
        num_envs: Number of robots.
        world: A built-in world or a world file, or a Scenario.
        sigma: Noise of the ranges [m] at range_max; the noise of the scenario if not given.
        max_steps: Steps after which an episode is cut off.
        render_mode: None; pictures are DriveEnv's.

    Raises:
        InputError: An argument is invalid.
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
        render_mode: str | None = None,
    ) -> None:
        if num_envs < 1 or max_steps < 1:
            raise InputError(f"num_envs {num_envs}, max_steps {max_steps}: expected at least 1")
        if render_mode is not None:
            raise InputError(
                f"render_mode {render_mode!r}: not available for many robots; use DriveEnv"
            )
        scenario = world if isinstance(world, Scenario) else load_scenario(world)
        self.num_envs, self.max_steps, self.render_mode = num_envs, max_steps, None
        self.task = DriveTask(scenario, num_envs, sigma=sigma)
        self.single_observation_space = _observation_space(self.task)
        self.single_action_space = spaces.Box(np.float32(-1.0), np.float32(1.0), (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._steps = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place all robots; the same seed gives the same episodes.

        Args:
            seed: The seed.
            options: ``pose`` (3,) and ``goal`` (2,) to set for all robots instead.

        Raises:
            InputError: One of the options is not finite numbers of this shape.
        """
        super().reset(seed=seed)
        self.task.place(np.arange(self.num_envs), self.np_random)
        options = options or {}
        if "pose" in options:
            self.task.poses[:] = as_pose(options["pose"])
        if "goal" in options:
            goal = numbers(options["goal"], "goal")
            if goal.shape != (2,) or not np.isfinite(goal).all():
                raise InputError(f"goal {shown(options['goal'])}: expected x, y [m]")
            self.task.goals[:] = goal
        self._steps[:], self._ended[:] = 0, False
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Observation, Array, Array, Array, dict[str, Any]]:
        """Drive with actions (num_envs, 2)."""
        again = self._ended
        rewards, reached, collided = self.task.step(np.where(again[:, None], 0.0, actions))
        self._steps += 1
        reached, collided = reached & ~again, collided & ~again
        ended = reached | collided
        cut = (self._steps >= self.max_steps) & ~ended & ~again
        if again.any():
            self.task.place(np.flatnonzero(again), self.np_random)
            self._steps[again] = 0
        self._ended = ended | cut
        rewards = np.where(again, 0.0, rewards)
        # Gymnasium's vector infos mark by a second array which environments have a value.
        valid = np.ones(self.num_envs, np.bool_)
        infos = {"reached": reached, "_reached": valid, "collided": collided, "_collided": valid}
        return self._observe(), rewards, ended, cut, infos

    def _observe(self) -> Observation:
        self.scan = self.task.scan(self.np_random)
        """Measured and true ranges, and walls, of the last step."""
        return self.task.observe(self.scan[0])


class DriveEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """A robot that drives to a goal by its range finder, without hitting a wall.

    The observation is ``ranges`` (beams,) [m] in float32, range_max without return and 0 below
    range_min, and ``goal`` (3,): distance [m], cosine and sine of the bearing. The action is v and
    ω, from −1 to 1 of the scenario's speed and of 1.5 rad/s, held until the next scan. The reward
    is 1 for each metre nearer to the goal, 10 at the goal, −10 at a wall, and −0.01 for each step.
    An episode ends at the goal or at a wall, and is truncated after max_steps.

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
        self._one = DriveVectorEnv(1, world, sigma=sigma, max_steps=max_steps)
        self.task = self._one.task
        self.observation_space = self._one.single_observation_space
        self.action_space = self._one.single_action_space
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.task.dt))}
        self._size, self._view = size, view
        self._window = Window("lrf3d") if render_mode == "human" else None
        self._film: list[tuple[Float, ...]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place the robot and its goal at random, or at the ``pose`` and the ``goal`` in options.

        The same seed gives the same episodes.

        Raises:
            InputError: One of the options is not finite numbers of its shape.
        """
        super().reset(seed=seed)
        self._one.np_random = self.np_random
        observation, _ = self._one.reset(options=options)
        self._film = []
        return self._shown(observation), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive with an action (2,)."""
        observation, rewards, ended, cut, infos = self._one.step(numbers([action], "action"))
        ends = {name: bool(infos[name][0]) for name in ("reached", "collided")}
        info = {**self._info(), **ends}
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
            ranges, truth, walls = self._one.scan
            self._film.append((self.task.poses[0].copy(), ranges[0], truth[0], walls[0]))
        if self._window is not None:
            self._window.show(self._picture(), self.task.dt)
        return {name: value[0] for name, value in observation.items()}

    def _picture(self) -> NDArray[np.uint8]:
        from lrf3d.render.video import frame

        poses, ranges, truth, walls = (np.array(column) for column in zip(*self._film, strict=True))
        times = self.task.dt * np.arange(len(poses))
        world, path = self.task.scenario.world, Trajectory(times, poses)
        obstacles = tuple(obstacle.until(times[-1]) for obstacle in self.task.scenario.obstacles)
        run = Run(world, self.task.lrf, path, ranges, truth, walls, (), (), obstacles)
        goal = (*self.task.goals[0].tolist(), GOAL_RADIUS)
        return frame(run, float(times[-1]), size=self._size, view=self._view, goal=goal)

    def _info(self) -> dict[str, Any]:
        return {"pose": self.task.poses[0].copy(), "goal": self.task.goals[0].copy()}


def _observation_space(task: DriveTask) -> spaces.Dict:
    """The observations of one robot, see `DriveEnv`."""
    low, high = [0.0, -1.0, -1.0], [task.farthest, 1.0, 1.0]
    top = np.float32(task.lrf.range_max)
    return spaces.Dict(
        {
            "goal": spaces.Box(np.array(low, np.float32), np.array(high, np.float32)),
            "ranges": spaces.Box(np.float32(0.0), top, (task.lrf.beams,), np.float32),
        }
    )
