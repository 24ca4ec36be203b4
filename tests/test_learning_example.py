"""The example that learns to drive: the network, an episode, and that it learns."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs pip install 'lrf3d[gym]'")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def example():
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        import learn_to_drive
    finally:
        sys.path.pop(0)
    return learn_to_drive


def test_both_of_a_pair_drive_the_same_way_with_the_same_network(example):
    robots = example.make_robots(8)
    rewards, reached = example.drive(robots, np.zeros(example.Network.size), 1, paired=True)
    assert rewards[:4] == pytest.approx(rewards[4:]) and not reached.any()


@pytest.mark.slow
def test_robots_learn_to_drive(example, tmp_path, monkeypatch, capsys):
    words = ["learn_to_drive.py", "--minutes", "0.5", "--robots", "256", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    example.main()
    assert (tmp_path / "curve.png").exists()
    curve = np.load(tmp_path / "network.npz")["curve"]
    assert curve[0, 2] < 0.1
    # How far it comes in half a minute depends on the machine.
    assert curve[:, 1].max() > curve[0, 1]
