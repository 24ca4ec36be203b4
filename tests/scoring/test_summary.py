"""The summary of a run: what is judged of a long one, and what is left out without a map."""

from dataclasses import replace

import numpy as np

import lrf3d
from lrf3d.scoring import map_score as summary


def test_of_a_long_run_a_sample_of_the_scans_is_judged(monkeypatch):
    room = lrf3d.load_world("paper_room")
    poses = [(1.0 + 0.4 * k, 1.0, 0.1 * k) for k in range(12)]
    run = lrf3d.simulate(room, poses, lrf3d.LaserRangeFinder(beams=61, range_max=14.0), rng=0)
    whole = summary.summarise(run)
    assert "judged_scans" not in whole and summary.judged_part(run) is run
    assert whole["score"]["length_f1"] > 0.9
    monkeypatch.setattr(summary, "MOST_JUDGED", 5)
    some = summary.summarise(run)
    assert some["judged_scans"] == 5 and some["drive"] == whole["drive"]
    assert some["map"] == whole["map"]
    times = summary.judged_part(run).trajectory.times
    assert len(times) == 5 and (np.diff(times) > 0.0).all()
    bare = summary.summarise(replace(run, snapshot_scans=(), maps=()))
    assert [bare[name] for name in ("map", "score", "buildings")] == [None] * 3
