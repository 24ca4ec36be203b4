"""Robots that learn to reach goals by PPO of Stable-Baselines3, all their beams cast together.

    python examples/learn_with_ppo.py --steps 300000

The robots, and what they see, are those of ``learn_to_drive.py``. ``Robots`` shows them to
Stable-Baselines3. The example needs ``pip install -e '.[gym]' stable-baselines3``, and writes the
policy and its learning curve.
"""

import argparse
from pathlib import Path

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from learn_to_drive import BEAMS, draw_curve, make_robots, seen
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

STEPS = 150
"""Length of an episode: 30 s, in which the robot can drive 120 m."""


class Robots(VecEnv):
    """Robots as Stable-Baselines3 has them: their observations are one array."""

    def __init__(self, count):
        self.robots = make_robots(count, STEPS, autoreset=AutoresetMode.SAME_STEP)
        observed = spaces.Box(-1.0, 1.0, (BEAMS + 3,), np.float32)
        super().__init__(count, observed, self.robots.single_action_space)

    def reset(self):
        """All robots are placed at random."""
        observation, _ = self.robots.reset(seed=self._seeds[0])
        self._reset_seeds()
        return seen(observation)

    def step_async(self, actions):
        """The actions of the next step."""
        self.actions = actions

    def step_wait(self):
        """One step of all robots; those that ended have been placed again."""
        observation, rewards, ended, cut, infos = self.robots.step(self.actions)
        told = [{} for _ in range(self.num_envs)]
        if (done := ended | cut).any():
            last = seen(infos["final_obs"])
            for robot in np.flatnonzero(done):
                told[robot]["terminal_observation"] = last[robot]
                told[robot]["TimeLimit.truncated"] = bool(cut[robot])
                told[robot]["reached"] = bool(infos["reached"][robot])
        return seen(observation), rewards.astype(np.float32), done, told

    def close(self):
        """Nothing is held."""

    def get_attr(self, attr_name, indices=None):
        """An attribute of the robots, for each of them."""
        return [getattr(self.robots, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name, value, indices=None):
        """Robots share their attributes."""
        setattr(self.robots, attr_name, value)

    def env_method(self, method_name, *args, indices=None, **options):
        """A method of the robots, called once."""
        return [getattr(self.robots, method_name)(*args, **options)]

    def env_is_wrapped(self, wrapper_class, indices=None):
        """No robot is wrapped."""
        return [False for _ in self._get_indices(indices)]


class Curve(BaseCallback):
    """Of the episodes of each rollout, the share that ended at the goal."""

    def __init__(self):
        super().__init__()
        self.points = []
        self.ended = []

    def _on_step(self):
        self.ended += [each["reached"] for each in self.locals["infos"] if each]
        return True

    def _on_rollout_end(self):
        self.points.append((self.num_timesteps, np.mean(self.ended)))
        self.ended = []
        print(f"{self.num_timesteps:9,} steps: at the goal {self.points[-1][1]:4.0%}", flush=True)


def main():
    """Learn for some steps."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--steps", type=int, default=300_000)
    parser.add_argument("--robots", type=int, default=64)
    parser.add_argument("--out", type=Path, default=Path("out/learn_with_ppo"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    robots = Robots(options.robots)
    model = PPO(
        "MlpPolicy",
        robots,
        n_steps=128,
        batch_size=1024,
        n_epochs=8,
        gamma=0.98,
        learning_rate=1e-3,
        ent_coef=0.002,
        seed=0,
        device="cpu",
    )
    curve = Curve()
    model.learn(options.steps, callback=curve)
    options.out.mkdir(parents=True, exist_ok=True)
    model.save(options.out / "policy.zip")
    steps, shares = np.transpose(curve.points)
    draw_curve(steps / 1e3, shares, options.out / "curve.png", unit="thousand steps")
    print(f"{options.out}/curve.png")


if __name__ == "__main__":
    main()
