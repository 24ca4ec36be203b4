"""Robots that drive to goals in one world, as a parallel environment of PettingZoo.

Each is an agent: ``robot1``, ``robot2``, …. They see and touch each other; a robot whose episode
has ended rests where it is.
"""

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import AutoresetMode

from lrf3d.base.errors import missing_extra
from lrf3d.gym import Array, DriveVectorEnv, Observation
from lrf3d.simulation.scenario import Scenario

try:
    from pettingzoo import ParallelEnv
except ModuleNotFoundError:
    raise missing_extra("parallel environments need PettingZoo", "pettingzoo") from None


class DriveParallelEnv(ParallelEnv):  # type: ignore[misc]
    """Robots of a `DriveVectorEnv` as agents, with its observations, actions and rewards.

    Args:
        robots: Number of robots.
        world: A built-in world or a world file, or a Scenario.
        **settings: ``sigma`` and ``max_steps`` of `DriveVectorEnv`.

    Raises:
        InputError: An argument is invalid, or there is no free space to drive in.
        WorldError: There is no such world.
    """

    metadata = {"name": "lrf3d_drive_v0", "render_modes": []}  # noqa: RUF012

    def __init__(
        self, robots: int = 4, world: str | Path | Scenario = "city", **settings: Any
    ) -> None:
        mode = AutoresetMode.DISABLED
        self.robots = DriveVectorEnv(robots, world, together=True, autoreset=mode, **settings)
        self.possible_agents = [f"robot{number}" for number in range(1, robots + 1)]
        self.agents = list[str]()
        self.render_mode = None

    def observation_space(self, agent: str) -> Space[Any]:
        """The space of an agent's observations."""
        return self.robots.single_observation_space

    def action_space(self, agent: str) -> Space[Any]:
        """The space of an agent's actions."""
        return self.robots.single_action_space

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Place all robots, as `DriveVectorEnv.reset` does."""
        self.agents = [*self.possible_agents]
        observation, _ = self.robots.reset(seed=seed, options=options)
        return self._each(observation), {agent: {} for agent in self.agents}

    def step(
        self, actions: dict[str, Array]
    ) -> tuple[
        dict[str, Observation],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Drive with an action (2,) for each agent; agents whose episode ends are removed."""
        given = [actions.get(agent, np.zeros(2)) for agent in self.possible_agents]
        observation, rewards, ended, cut, found = self.robots.step(np.array(given))
        numbers = {agent: self.possible_agents.index(agent) for agent in self.agents}
        seen = self._each(observation)
        self.agents = [agent for agent, k in numbers.items() if not (ended[k] or cut[k])]
        return (
            seen,
            {agent: float(rewards[k]) for agent, k in numbers.items()},
            {agent: bool(ended[k]) for agent, k in numbers.items()},
            {agent: bool(cut[k]) for agent, k in numbers.items()},
            {
                agent: {name: bool(found[name][k]) for name in ("reached", "collided")}
                for agent, k in numbers.items()
            },
        )

    def _each(self, observation: Observation) -> dict[str, Observation]:
        rows = zip(self.possible_agents, *observation.values(), strict=True)
        each = {agent: dict(zip(observation, row, strict=True)) for agent, *row in rows}
        return {agent: each[agent] for agent in self.agents}


# PettingZoo's name for it.
parallel_env = DriveParallelEnv
