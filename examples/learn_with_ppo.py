"""Robots that learn to reach goals by PPO of Stable-Baselines3, all their beams cast together.

    python examples/learn_with_ppo.py --steps 300000

Robots start anywhere in the city, and each drives to a goal between 5 and 20 m away by its ranges.
``Robots`` shows the environment of many robots to Stable-Baselines3. The example needs
``pip install -e '.[gym]' stable-baselines3``, and writes the policy and its learning curve.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from matplotlib.figure import Figure
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

import lrf3d
from lrf3d.gym import DriveVectorEnv

BEAMS = 31
"""Beams of the range finder: a small network learns faster."""

STEPS = 150
"""Length of an episode: 30 s, in which the robot can drive 120 m."""

NEAR, FAR = 3.0, 10.0
"""Distances [m] over which walls and goals matter: those farther away look alike."""


class Robots(VecEnv):
    """Robots as Stable-Baselines3 has them: their observations are one array from 0 to 1."""

    def __init__(self, count):
        lrf = lrf3d.LaserRangeFinder(beams=BEAMS, range_max=20.0)
        city = replace(lrf3d.load_scenario("city"), lrf=lrf)
        self.robots = DriveVectorEnv(
            count, city, sigma=0.0, max_steps=STEPS, autoreset=AutoresetMode.SAME_STEP
        )
        seen = spaces.Box(-1.0, 1.0, (BEAMS + 3,), np.float32)
        super().__init__(count, seen, self.robots.single_action_space)

    @staticmethod
    def seen(observation):
        """Observations (k, beams + 3) as the network sees them."""
        distance, cos, sin = observation["goal"].T
        walls = np.exp(-observation["ranges"] / NEAR)
        goals = np.column_stack([np.minimum(distance, FAR) / FAR, cos, sin])
        return np.concatenate([walls, goals], axis=1).astype(np.float32)

    def reset(self):
        """All robots are placed at random."""
        observation, _ = self.robots.reset(seed=self._seeds[0])
        self._reset_seeds()
        return self.seen(observation)

    def step_async(self, actions):
        """The actions of the next step."""
        self.actions = actions

    def step_wait(self):
        """One step of all robots; those that ended have been placed again."""
        observation, rewards, ended, cut, infos = self.robots.step(self.actions)
        told = [{} for _ in range(self.num_envs)]
        if (done := ended | cut).any():
            last = self.seen(infos["final_obs"])
            for robot in np.flatnonzero(done):
                told[robot]["terminal_observation"] = last[robot]
                told[robot]["TimeLimit.truncated"] = bool(cut[robot])
                told[robot]["reached"] = bool(infos["reached"][robot])
        return self.seen(observation), rewards.astype(np.float32), done, told

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


def draw_curve(points, path):
    """Draw how many robots reach their goal over the steps of learning."""
    steps, shares = np.transpose(points)
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(steps / 1e3, 100.0 * shares, color="tab:blue")
    axes.set(xlabel="thousand steps", ylabel="robots at their goal [%]", ylim=(0, 100))
    axes.set_title("Learning to drive in the city by PPO")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


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
    draw_curve(curve.points, options.out / "curve.png")
    print(f"{options.out}/curve.png")


if __name__ == "__main__":
    main()
