"""The summary of a run: what is judged of a long one, and what is left out without a map."""

from dataclasses import replace

import numpy as np
import pytest

import lrf3d
from lrf3d.scoring import summary


@pytest.fixture(scope="module")
def run():
    room = lrf3d.load_world("paper_room")
    poses = [(1.0 + 0.4 * k, 1.0, 0.1 * k) for k in range(12)]
    lrf = lrf3d.LaserRangeFinder(beams=61, range_max=14.0)
    return lrf3d.simulate(room, poses, lrf, rng=0)


def test_of_a_long_run_a_sample_of_the_scans_is_judged(run, monkeypatch):
    whole = summary.summarise(run, None)
    assert "judged_scans" not in whole and summary.judged_part(run) is run
    monkeypatch.setattr(summary, "MOST_JUDGED", 5)
    some = summary.summarise(run, None)
    assert some["judged_scans"] == 5 and some["drive"] == whole["drive"]
    assert some["map"] == whole["map"]
    times = summary.judged_part(run).trajectory.times
    assert len(times) == 5 and (np.diff(times) > 0.0).all()


def test_without_a_map_its_figures_are_none(run):
    bare = summary.summarise(replace(run, snapshot_scans=(), maps=()), lrf3d.LineMapper().local_map)
    assert [bare[name] for name in ("map", "score", "buildings", "storage")] == [None] * 4


def test_storage_is_that_of_the_maps_of_single_scans(run):
    found = summary.summarise(run, lrf3d.LineMapper().local_map)
    assert found["storage"] and found["score"]["length_f1"] > 0.9
