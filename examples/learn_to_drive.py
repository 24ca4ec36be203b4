"""A robot that learns to drive: evolution strategies and a small network, in NumPy alone.

    python examples/learn_to_drive.py --minutes 3

Robots start anywhere in the city, and each drives to a goal between 5 and 20 m away by its ranges.
Each is given a network that differs a little from the present one. After an episode the present
network moves towards those that were rewarded best (Salimans et al., *Evolution Strategies as a
Scalable Alternative to Reinforcement Learning*, 2017). It needs ``pip install -e '.[gym]'``, and
writes the network and its learning curve beside each other.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import lrf3d
from lrf3d.gym import DriveVectorEnv

BEAMS, NEURONS = 31, 16
"""Size of the network: its inputs are the beams and the goal, its outputs v and ω."""

STEPS = 75
"""Length of an episode: 15 s, in which the robot can drive 60 m."""

SPREAD, RATE = 0.1, 0.04
"""Standard deviation of the networks' weights around the present ones, and the step of learning."""

NEAR, FAR = 3.0, 10.0
"""Distances [m] over which walls and goals matter: those farther away look alike."""


def seen(observation):
    """Observations as one array (k, beams + 3) from −1 to 1."""
    distance, cos, sin = observation["goal"].T
    walls = np.exp(-observation["ranges"] / NEAR)
    return np.column_stack([walls, np.minimum(distance, FAR) / FAR, cos, sin])


class Network:
    """A policy of one hidden layer; all weights are one vector.

    Attributes:
        size: Number of weights.
    """

    shapes = ((BEAMS + 4, NEURONS), (NEURONS + 1, 2))
    size = sum(rows * columns for rows, columns in shapes)

    @classmethod
    def actions(cls, weights, observation):
        """Actions (k, 2) from −1 to 1 of k robots with weights (k, size), or the same (size,)."""
        values = seen(observation)
        begin = 0
        for rows, columns in cls.shapes:
            layer = weights[..., begin : begin + rows * columns].reshape(-1, rows, columns)
            begin += rows * columns
            values = np.column_stack([values, np.ones(len(values))])
            values = np.tanh((values[:, None] @ layer)[:, 0])
        return values


def make_robots(count, max_steps, **options):
    """Robots in the city, with a range finder of few beams and no noise."""
    lrf = lrf3d.LaserRangeFinder(beams=BEAMS, range_max=20.0)
    city = replace(lrf3d.load_scenario("city"), lrf=lrf)
    return DriveVectorEnv(count, city, sigma=0.0, max_steps=max_steps, **options)


def drive(robots, weights, seed, *, paired=False):
    """One episode of each robot: the sum of its rewards (k,), and whether it reached its goal."""
    observation, _ = robots.reset(seed=seed)
    half = robots.num_envs // 2
    if paired:
        # Both of a pair have the same start and goal, so that only their networks differ.
        robots.poses[half:], robots.goals[half:] = robots.poses[:half], robots.goals[:half]
        observation, *_ = robots.step(np.zeros((robots.num_envs, 2)))
    rewards = np.zeros(robots.num_envs)
    driving = np.ones(robots.num_envs, dtype=bool)
    reached = np.zeros(robots.num_envs, dtype=bool)
    for _ in range(STEPS):
        observation, gained, ended, _, infos = robots.step(Network.actions(weights, observation))
        rewards += np.where(driving, gained, 0.0)
        reached |= driving & infos["reached"]
        driving &= ~ended
        if not driving.any():
            break
    return rewards, reached


def learn(robots, *, seconds, rng):
    """The learnt weights, and the curve (n, 3): seconds, mean reward, share at the goal."""
    half = robots.num_envs // 2
    weights = 0.1 * rng.standard_normal(Network.size)
    mean, square = np.zeros(Network.size), np.zeros(Network.size)
    curve, begin, generation = [], time.monotonic(), 0
    while True:
        if generation % 10 == 0:
            rewards, reached = drive(robots, weights, seed=0)
            passed = time.monotonic() - begin
            curve.append((passed, rewards.mean(), reached.mean()))
            print(
                f"{passed:5.0f} s: reward {rewards.mean():6.2f}, at the goal {reached.mean():4.0%}"
            )
            if passed >= seconds:
                return weights, np.array(curve)
        generation += 1
        noise = rng.standard_normal((half, Network.size))
        tried = weights + SPREAD * np.concatenate([noise, -noise])
        rewards, _ = drive(robots, tried, seed=generation, paired=True)
        # Only the order of the rewards counts, so that one crash is not worth ten good drives.
        ranks = rewards.argsort().argsort() / (len(rewards) - 1.0) - 0.5
        gradient = (ranks[:half] - ranks[half:]) @ noise / (half * SPREAD)
        # Adam, with the usual constants.
        mean, square = 0.9 * mean + 0.1 * gradient, 0.999 * square + 0.001 * gradient**2
        unbiased = mean / (1.0 - 0.9**generation)
        scale = np.sqrt(square / (1.0 - 0.999**generation))
        weights = weights + RATE * unbiased / (scale + 1e-8)


def draw_curve(effort, shares, path, *, unit):
    """Draw which share of the robots reach their goal over the effort of learning, in a unit."""
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(effort, 100.0 * shares, color="tab:blue")
    axes.set(xlabel=unit, ylabel="robots at their goal [%]", ylim=(0, 100))
    axes.set_title("Learning to drive in the city")
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def main():
    """Learn for some minutes."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=3.0)
    parser.add_argument("--robots", type=int, default=512, help="an even number")
    parser.add_argument("--out", type=Path, default=Path("out/learn_to_drive"))
    options = parser.parse_args()
    robots = make_robots(options.robots, STEPS + 1)
    rng = np.random.default_rng(0)
    weights, curve = learn(robots, seconds=60.0 * options.minutes, rng=rng)
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez(options.out / "network.npz", weights=weights, curve=curve)
    draw_curve(curve[:, 0] / 60.0, curve[:, 2], options.out / "curve.png", unit="minutes")
    print(f"{options.out}/curve.png")


if __name__ == "__main__":
    main()
