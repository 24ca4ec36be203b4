"""The examples that learn to drive: they learn."""

import re
import sys
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="needs pip install 'lrf3d[gym]'")

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_robots_learn_to_drive(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(ROOT / "examples")
    import learn_to_drive

    # Half a minute are twenty generations, whatever the machine takes for them.
    clock = SimpleNamespace(monotonic=count(0, 10).__next__)
    monkeypatch.setattr(learn_to_drive, "time", clock)
    words = ["learn_to_drive.py", "--minutes", "0.5", "--robots", "256", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    learn_to_drive.main()
    assert (tmp_path / "curve.png").exists()
    curve = np.load(tmp_path / "network.npz")["curve"]
    assert curve[0, 2] < 0.1 < 0.5 < curve[-1, 2]


@pytest.mark.slow
def test_robots_learn_by_ppo(tmp_path, monkeypatch, capsys):
    pytest.importorskip("stable_baselines3")
    # The folder of the tests of environments is not the old library of this name.
    monkeypatch.setitem(sys.modules, "gym", None)
    monkeypatch.syspath_prepend(ROOT / "examples")
    import learn_with_ppo

    words = ["learn_with_ppo.py", "--steps", "40000", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    learn_with_ppo.main()
    assert {each.name for each in tmp_path.iterdir()} == {"curve.png", "policy.zip"}
    first, *_, last = re.findall(r"at the goal +(\d+)%", capsys.readouterr().out)
    assert int(last) > 2 * int(first)
