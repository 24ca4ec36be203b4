import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lrf3d import LaserRangeFinder, PlanarCaster
from stress import CASES, stress, worlds
from stress.beams import mixture
from stress.casting import CASTERS, CASTING, allowed, try_batch
from stress.certificate import certified, directions
from stress.certify import UNDECIDED, certify

TESTS = Path(__file__).parent

seeds = st.integers(0, 2**32 - 1)


def batch_of(seed, beams=200):
    return mixture(np.random.default_rng(seed), beams)


def decided(batch):
    """What error bounds alone decide: walls, ranges, rests and slacks (k, beams)."""
    beams = directions(batch.lrf, batch.poses)
    walls = np.empty(beams.shape[:2], dtype=np.int64)
    numbers = [np.empty(walls.shape) for _ in range(3)]
    limits = batch.lrf.range_min, batch.lrf.range_max
    certify(batch.segments, batch.poses[:, :2].copy(), beams, limits, walls, *numbers)
    return walls, *numbers


def everything(batch):
    return np.ones((len(batch.poses), batch.lrf.beams), dtype=bool)


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_what_bounds_decide_rationals_confirm(seed):
    batch = batch_of(seed)
    truth = certified(batch.segments, batch.lrf, batch.poses, everything(batch))
    assert truth.rational.all() and truth.contradictions == 0
    walls, ranges, rest, slack = decided(batch)
    known = walls != UNDECIDED
    assert np.array_equal(walls[known], truth.walls[known])
    hits = known & (walls >= 0)
    assert np.array_equal(ranges[known & ~hits], truth.ranges[known & ~hits])
    gap = (ranges[hits] - truth.ranges[hits]) + (rest[hits] - truth.rest[hits])
    assert (np.abs(gap) <= slack[hits]).all()
    assert (slack[hits] <= 2.0**-7 * np.spacing(ranges[hits])).all()


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_walls_on_whole_metres_are_never_decided_wrongly(seed):
    rng = np.random.default_rng(seed)
    walls = rng.integers(-3, 4, (12, 4)).astype(float)
    walls = walls[(walls[:, :2] != walls[:, 2:]).any(axis=1)]
    lrf = LaserRangeFinder(0.0, 1.5 * np.pi, 4, float(rng.integers(3)), float(rng.integers(3, 6)))
    poses = np.column_stack([rng.integers(-3, 4, (30, 2)), np.zeros(30)]).astype(float)
    outright = np.ones((30, 4), dtype=bool)
    assert certified(walls, lrf, poses, outright).contradictions == 0


def test_bounds_decide_all_ordinary_beams():
    case = next(case for case in CASES if case.name == "fans in a city")
    tally = case.attempt(np.random.default_rng(0), 20_000, 0)
    assert tally.counts["certified_by_rationals"] <= 2e-3 * tally.tried


def test_walls_alike_are_a_tie_that_bounds_decide():
    walls = np.array([[3, 1, 3, -1], [2, -1, 2, 1], [2, 1, 2, -1], [2, -1, 2, 1.0]])
    truth = certified(walls, LaserRangeFinder(-0.1, 0.1, 5), np.array([[0.0, 0.0, 0.0]]))
    assert truth.walls.tolist() == [[1] * 5] and not truth.rational.any()


def lies(seed):
    """The truth about a batch, right claims, and which beams return."""
    batch = batch_of(seed, 120)
    truth = certified(batch.segments, batch.lrf, batch.poses)
    assert not truth.judge(truth.ranges, truth.walls).wrong.any()
    return truth, np.array(truth.ranges), np.array(truth.walls), truth.walls >= 0


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_a_wrong_wall_is_caught(seed):
    truth, ranges, walls, hits = lies(seed)
    assert truth.judge(ranges, walls + 1).wrong.all()
    assert truth.judge(ranges, np.where(hits, -1, 0)).wrong.all()


@given(seeds, st.sampled_from([-1, 1]))
@settings(max_examples=25, deadline=None)
def test_a_range_off_by_3_ulp_is_caught(seed, sign):
    truth, ranges, walls, hits = lies(seed)
    # By 3 units, to either side; not where that leaves the limits, which is caught as wrong.
    moved = np.where(hits, ranges + 3 * sign * np.spacing(ranges), ranges)
    verdict = truth.judge(moved, walls)
    caught = verdict.wrong | (verdict.errors > allowed("planar", verdict))
    # At the bottom of a binade 3 units down are 1.5 of the larger units above.
    bottom = np.frexp(ranges)[0] == 0.5
    assert np.array_equal(caught | (hits & bottom), hits)


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_missed_hits_and_false_hits_are_caught(seed):
    truth, ranges, walls, hits = lies(seed)
    nothing = np.full(ranges.shape, np.inf), np.full(walls.shape, -1)
    assert np.array_equal(truth.judge(*nothing).wrong, hits | (ranges == -np.inf))
    somewhere = np.where(hits, ranges, 0.5 * truth.limits[1]), np.where(hits, walls, 0)
    assert np.array_equal(truth.judge(*somewhere).wrong, ~hits)
    for bad in (np.nan, np.inf, -np.inf):
        assert truth.judge(np.where(hits, bad, ranges), walls).wrong[hits].all()


def test_a_finite_range_outside_the_limits_is_caught():
    walls = np.array([[2.0, -1.0, 2.0, 1.0]])
    for low, high, claim in (
        (0.0, 2.0, np.nextafter(2.0, 3.0)),
        (2.0, 9.0, np.nextafter(2.0, 1.0)),
    ):
        lrf = LaserRangeFinder(0.0, 0.0, 1, low, high)
        truth = certified(walls, lrf, np.zeros((1, 3)))
        assert truth.ranges == 2.0 and truth.rational.all()
        assert not truth.judge(truth.ranges, truth.walls).wrong.any()
        assert truth.judge(np.array([[claim]]), truth.walls).wrong.all()


def test_a_range_of_embree_off_by_more_than_a_nanometre_is_caught():
    truth, ranges, walls, hits = lies(1)
    for off, caught in ((1.1e-9, True), (0.9e-9, False)):
        verdict = truth.judge(np.where(hits, ranges + off, ranges), walls)
        near = hits & (ranges < 1e3)
        assert near.any()
        assert (verdict.errors > allowed("embree", verdict))[near].tolist() == [caught] * near.sum()


class Liar(PlanarCaster):
    """Sends every 50th beam to the second wall that it would meet: through the first."""

    def scan_batch(self, lrf, poses):
        ranges, walls = super().scan_batch(lrf, poses)
        walls.reshape(-1)[::50] = (walls.reshape(-1)[::50] + 1) % len(self.world.segments)
        return ranges, walls


def test_a_caster_that_lies_fails_the_run_and_leaves_an_example(monkeypatch):
    monkeypatch.setitem(CASTERS, "planar", Liar)
    report = stress(len(CASTING) * 100, parts=("casting",), processes=1)
    assert not report.passed
    assert all(tally.counts["planar.wrong"] >= 2 for _, tally in report.rows)
    assert all(tally.counts["embree.wrong"] == 0 for _, tally in report.rows)
    failure = report.as_dict()["failures"][0]
    assert failure["row"] == CASTING[0].name and failure["caster"] == "planar"
    # The example is enough to repeat the beam.
    truth = certified(
        np.array(failure["segments"]),
        LaserRangeFinder(**failure["laser"]),
        np.array([failure["pose"]]),
    )
    assert truth.walls[0, failure["beam"]] == failure["true"]["wall"]
    assert repr(float(truth.ranges[0, failure["beam"]])) == failure["true"]["range"]


def test_a_run_repeats_whatever_the_processes():
    one, two = (
        stress(4_000, rationals=300, parts=("casting", "angles"), quick=True, seed=5, processes=n)
        for n in (1, 2)
    )
    assert one.passed and one.complete
    counts = one.total.counts
    assert one.total.tried >= 4_000 and counts["outright_by_rationals"] >= 300
    assert counts["certified_by_bound"] + counts["certified_by_rationals"] == one.total.tried
    assert [tally for _, tally in one.rows] == [tally for _, tally in two.rows]
    assert replace(two, seconds=one.seconds) == one


def test_a_run_that_is_out_of_time_reports_what_it_tried():
    report = stress(10**9, seconds=0.0, processes=1)
    assert not report.complete and report.passed
    assert "time was over" in report.text()
    json.dumps(report.as_dict(), allow_nan=False)


def test_every_case_tries_at_least_what_is_asked():
    rng = np.random.default_rng(0)
    for case in CASTING:
        tally = case.attempt(rng, 300, 30)
        assert tally.tried >= 300 and tally.counts["outright_by_rationals"] >= 30, case.name


def test_a_batch_of_misses_has_no_error():
    batch = batch_of(3)
    lrf = LaserRangeFinder(0.0, 1.0, 3, 0.0, 1e-6)
    far = replace(batch, lrf=lrf, poses=np.array([[1e4, 1e4, 0.0]]))
    tally = try_batch(far, np.zeros((1, 3), dtype=bool))
    assert tally.failed == 0 and len(tally.largest) == 4
    assert all(error == 0.0 for error in tally.largest.values())


def command(*arguments):
    done = subprocess.run(
        [sys.executable, "-m", "stress", *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONWARNINGS": "error", "PYTHONPATH": f"{TESTS}:{TESTS.parent}"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_the_command_prints_one_json_object():
    report = json.loads(command(*"--beams 3000 --rationals 100 --json --part casting".split()))
    assert report["passed"] and report["complete"] and report["beams"] >= 3000
    assert report["outright_by_rationals"] >= 100 and report["contradictions"] == 0
    assert report["planar"]["wrong"] == report["embree"]["wrong"] == 0
    assert len(report["rows"]) == len(CASTING) and report["failures"] == []


@pytest.mark.slow
def test_the_command_prints_a_table():
    parts = "casting", "lines", "angles"
    chosen = [word for part in parts for word in ("--part", part)]
    text = command("--beams", "3000", "--rationals", "0", "--quick", *chosen)
    assert all(case.name in text for case in CASES if case.part in parts)


@pytest.mark.parametrize("count", [1, 16])
def test_worlds_are_small_and_have_no_walls_without_length(count):
    rng = np.random.default_rng(count)
    for _ in range(50):
        walls = worlds.placed(worlds.any_world(rng, count), 1.0, np.zeros(2))
        assert 0 < len(walls) <= 64 and np.abs(walls).max() < 20.0
