"""The hardest beams against fractions, in short; scripts/stress runs it for longer."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import stress
from lrf3d import EmbreeCaster, PlanarCaster
from lrf3d.casting.light import Lighting
from stress import KINDS, aimed, app, check_batch, check_light, lit, try_kind


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_the_hardest_beams_are_cast_right(kind, seed):
    findings = try_kind(kind, 8, (seed,))
    assert findings.beams > 100 and findings.wrong == 0, findings.examples
    assert findings.left_out <= 0.01 * findings.beams


class ThroughTheFirstWall(PlanarCaster):
    def scan_batch(self, lrf, poses):
        ranges, walls = super().scan_batch(lrf, poses)
        walls.reshape(-1)[::50] = (walls.reshape(-1)[::50] + 1) % len(self.world.segments)
        return ranges, walls


class OffByTwoUlps(PlanarCaster):
    def scan_batch(self, lrf, poses):
        ranges, walls = super().scan_batch(lrf, poses)
        hit = np.isfinite(ranges)
        ranges[hit] += 2.0 * np.spacing(ranges[hit])
        return ranges, walls


class Blind(PlanarCaster):
    def scan_batch(self, lrf, poses):
        ranges, walls = super().scan_batch(lrf, poses)
        return np.full_like(ranges, np.inf), np.full_like(walls, -1)


@pytest.mark.parametrize("liar", [ThroughTheFirstWall, OffByTwoUlps, Blind])
def test_a_caster_that_lies_is_caught_and_leaves_an_example(liar):
    wrong = [check_batch(aimed(np.random.default_rng(seed)), (EmbreeCaster, liar)).wrong
             for seed in range(10)]  # fmt: skip
    assert sum(count > 0 for count in wrong) >= 5


def test_light_that_is_off_by_two_nanometres_is_caught(monkeypatch):
    right = Lighting.light

    def off(self, lrf, tree, poses, lit, part):
        right(self, lrf, tree, poses, lit, part)
        lit.ranges[part] += 2e-9

    monkeypatch.setattr(Lighting, "light", off)
    rng = np.random.default_rng(0)
    findings = check_light(lit(rng), rng)
    assert findings.wrong > 10 and findings.examples[0]["laser"].startswith("LaserRangeFinder")


def test_the_command_prints_one_json_object(monkeypatch):
    monkeypatch.setattr(stress, "ROUND", 2)
    done = CliRunner().invoke(app, ["--beams", "400", "--json"])
    report = json.loads(done.stdout)
    assert done.exit_code == 0 and report["passed"] and report["beams"] >= 400
    assert [row["name"] for row in report["rows"]] == list(KINDS)
