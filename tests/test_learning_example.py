"""The example that learns to drive: it learns."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs pip install 'lrf3d[gym]'")

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_robots_learn_to_drive(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(ROOT / "examples")
    import learn_to_drive

    words = ["learn_to_drive.py", "--minutes", "0.5", "--robots", "256", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    learn_to_drive.main()
    assert (tmp_path / "curve.png").exists()
    curve = np.load(tmp_path / "network.npz")["curve"]
    assert curve[0, 2] < 0.1
    # How far it comes in half a minute depends on the machine.
    assert curve[:, 1].max() > curve[0, 1]
