"""DriveEnv: one robot of a DriveTask as an environment of Gymnasium."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lrf3d.errors import InputError, shown
from lrf3d.geometry import Float, numbers
from lrf3d.gym.task import GOAL_RADIUS, DriveTask
from lrf3d.pose import as_pose
from lrf3d.render.window import Window
from lrf3d.robot import Trajectory
from lrf3d.run import Run
from lrf3d.scenario import Scenario
from lrf3d.scenario_file import load_scenario

MAX_STEPS = 500
"""Default number of steps after which an episode is truncated."""


Observation = dict[str, NDArray[np.float32]]


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
        if max_steps < 1:
            raise InputError(f"max_steps {max_steps}: expected at least 1")
        scenario = world if isinstance(world, Scenario) else load_scenario(world)
        self.task = DriveTask(scenario, 1, sigma=sigma)
        self.observation_space: spaces.Space[Any] = observation_space(self.task)
        self.action_space: spaces.Space[Any] = action_space()
        self.render_mode, self.max_steps = render_mode, max_steps
        self.metadata = {**self.metadata, "render_fps": max(1, round(1.0 / self.task.dt))}
        self._size, self._view = size, view
        self._window = Window("lrf3d") if render_mode == "human" else None
        self._steps = 0
        self._film: list[tuple[Float, ...]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Place the robot and its goal at random.

        Args:
            seed: The same seed gives the same episodes.
            options: ``pose`` (3,) and ``goal`` (2,) to set instead.

        Raises:
            InputError: One of the options is not finite numbers of this shape.
        """
        super().reset(seed=seed)
        self.task.place(np.array([0]), self.np_random)
        options = options or {}
        if "pose" in options:
            self.task.poses[0] = as_pose(options["pose"])
        if "goal" in options:
            goal = numbers(options["goal"], "goal")
            if goal.shape != (2,) or not np.isfinite(goal).all():
                raise InputError(f"goal {shown(options['goal'])}: expected x, y [m]")
            self.task.goals[0] = goal
        self._steps, self._film = 0, []
        observation = self._observe()
        self._show()
        return observation, self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Drive with an action (2,)."""
        outcome = self.task.step([action])
        self._steps += 1
        reached, collided = bool(outcome.reached[0]), bool(outcome.collided[0])
        info = {**self._info(), "reached": reached, "collided": collided}
        ended = reached or collided
        cut = self._steps >= self.max_steps and not ended
        observation = self._observe()
        self._show()
        return observation, float(outcome.rewards[0]), ended, cut, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (h, w, 3) uint8 of the current state, as in a film, with the goal.

        None without a render_mode, and with ``human``, where the window shows it.
        """
        return self._picture() if self.render_mode == "rgb_array" and self._film else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()

    def _show(self) -> None:
        if self._window is not None:
            self._window.show(self._picture(), self.task.dt)

    def _picture(self) -> NDArray[np.uint8]:
        from lrf3d.render.video import frame

        poses, ranges, truth, walls = (np.array(column) for column in zip(*self._film, strict=True))
        times = self.task.dt * np.arange(len(poses))
        world, path = self.task.scenario.world, Trajectory(times, poses)
        obstacles = tuple(obstacle.until(times[-1]) for obstacle in self.task.scenario.obstacles)
        run = Run(world, self.task.lrf, path, ranges, truth, walls, (), (), obstacles)
        goal = (*self.task.goals[0].tolist(), GOAL_RADIUS)
        return frame(run, float(times[-1]), size=self._size, view=self._view, goal=goal)

    def _observe(self) -> Observation:
        ranges, truth, walls = self.task.scan(self.np_random)
        if self.render_mode is not None:
            self._film.append((self.task.poses[0].copy(), ranges[0], truth[0], walls[0]))
        return {name: value[0] for name, value in self.task.observe(ranges).items()}

    def _info(self) -> dict[str, Any]:
        return {"pose": self.task.poses[0].copy(), "goal": self.task.goals[0].copy()}


def observation_space(task: DriveTask) -> spaces.Dict:
    """The observations of one robot.

    ``ranges`` (beams,) [m] from 0 to range_max; ``goal`` (3,): its distance [m], and the cosine
    and the sine of its bearing, 1 and 0 ahead.
    """
    top = np.float32(task.lrf.range_max)
    far = np.float32(task.farthest)
    return spaces.Dict(
        {
            "goal": spaces.Box(
                np.array([0.0, -1.0, -1.0], np.float32), np.array([far, 1.0, 1.0], np.float32)
            ),
            "ranges": spaces.Box(np.float32(0.0), top, (task.lrf.beams,), np.float32),
        }
    )


def action_space() -> spaces.Box:
    """The actions of one robot: speed and turn rate, from −1 to 1 of their maximum."""
    return spaces.Box(np.float32(-1.0), np.float32(1.0), (2,), np.float32)
