"""DriveVectorEnv: many robots of a DriveTask at once; all their beams are cast together."""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lrf3d.errors import InputError
from lrf3d.gym.drive_env import MAX_STEPS, action_space, observation_space
from lrf3d.gym.task import DriveTask
from lrf3d.scenario import Scenario
from lrf3d.scenario_file import load_scenario

Observations = dict[str, NDArray[np.float32]]
Array = NDArray[Any]


class DriveVectorEnv(VectorEnv[Observations, Array, Array]):
    """Robots that each drive to a goal, as in DriveEnv, in one world without seeing each other.

    A robot whose episode has ended is placed anew in the step after (autoreset ``NextStep``);
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
        self.single_observation_space = observation_space(self.task)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._steps = np.zeros(num_envs, np.int64)
        self._ended = np.zeros(num_envs, np.bool_)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Place all robots; the same seed gives the same episodes."""
        super().reset(seed=seed)
        self.task.place(np.arange(self.num_envs), self.np_random)
        self._steps[:], self._ended[:] = 0, False
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Observations, Array, Array, Array, dict[str, Any]]:
        """Drive with actions (num_envs, 2)."""
        anew = self._ended
        outcome = self.task.step(np.where(anew[:, None], 0.0, actions))
        self._steps += 1
        reached, collided = outcome.reached & ~anew, outcome.collided & ~anew
        ended = reached | collided
        cut = (self._steps >= self.max_steps) & ~ended & ~anew
        if anew.any():
            self.task.place(np.flatnonzero(anew), self.np_random)
            self._steps[anew] = 0
        self._ended = ended | cut
        rewards = np.where(anew, 0.0, outcome.rewards)
        # Gymnasium's vector infos mark by a second array which environments have a value.
        valid = np.ones(self.num_envs, np.bool_)
        infos = {"reached": reached, "_reached": valid, "collided": collided, "_collided": valid}
        return self._observe(), rewards, ended, cut, infos

    def _observe(self) -> Observations:
        ranges, _, _ = self.task.scan(self.np_random)
        return self.task.observe(ranges)
