"""Stages: light is baked once for a run, and handed to other processes."""

import numpy as np
from test_render import city_run, kept_for_users

from lrf3d.scene.stage import stage as module
from lrf3d.scene.stage.stage import stage_of


def assert_same(one, other):
    for first, second in zip(one.faces, other.faces, strict=True):
        assert np.array_equal(first, second)
    assert np.array_equal(one.ground.picture, other.ground.picture)


def test_the_stage_of_a_run_is_painted_once(monkeypatch):
    (run, other), painted = (city_run.__wrapped__() for _ in range(2)), []
    paint = module.paint_stage
    monkeypatch.setattr(module, "_in_memory", kept_for_users)
    monkeypatch.setattr(module, "paint_stage", lambda *each: painted.append(1) or paint(*each))
    assert stage_of(run) is stage_of(run) and len(painted) == 1
    assert_same(stage_of(run), stage_of(other))
    assert len(painted) == 2
