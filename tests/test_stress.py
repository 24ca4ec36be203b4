"""The hardest beams against fractions, in short; scripts/stress runs it for longer."""

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from program import lrf3d as called

import stress
from lrf3d import PlanarCaster
from lrf3d.casting.light import Lighting
from stress import KINDS, aimed, check_batch, check_light, command, lit, try_kind


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_hardest_beams_are_cast_right(kind, seed):
    findings = try_kind(kind, 8, (seed,))
    assert findings.beams > 100 and findings.wrong == 0, findings.examples
    assert findings.left_out <= 0.01 * findings.beams


def test_a_caster_that_is_off_by_two_ulps_is_caught_and_leaves_an_example():
    class Liar(PlanarCaster):
        def scan_batch(self, lrf, poses):
            ranges, walls = super().scan_batch(lrf, poses)
            return ranges + 2.0 * np.spacing(np.where(walls < 0, 0.0, ranges)), walls

    found = [check_batch(aimed(np.random.default_rng(seed)), (Liar,)) for seed in range(3)]
    assert all(one.wrong and "walls" in one.examples[0] for one in found)


def test_light_that_is_off_by_two_nanometres_is_caught(monkeypatch):
    right = Lighting.light

    def off(self, lrf, tree, rays, lit, *obstacles):
        right(self, lrf, tree, rays, lit, *obstacles)
        lit.ranges[:] += 2e-9

    monkeypatch.setattr(Lighting, "light", off)
    rng = np.random.default_rng(0)
    findings = check_light(lit(rng), rng)
    assert findings.wrong > 10 and findings.examples[0]["laser"].startswith("LaserRangeFinder")


def test_the_command_prints_one_json_object(monkeypatch):
    monkeypatch.setattr(stress, "ROUND", 2)
    monkeypatch.setattr(stress, "process_pool", ThreadPoolExecutor)
    done = called("--beams", "400", "--json", program=command)
    report = json.loads(done.stdout)
    assert done.returncode == 0 and report["passed"] and report["beams"] >= 400
    assert [row["name"] for row in report["rows"]] == list(KINDS)
    wrong = called("--seed", "-1", program=command)
    assert wrong.returncode == 2 and "'-1': expected a whole number from 0" in wrong.stderr
