"""Stages: light is baked once, handed to other processes, and found again by later films."""

import os
import pickle

import numpy as np
import pytest
from test_render import city_run

from lrf3d.scene import stage as module
from lrf3d.scene.stage import stage_of


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A cache folder of its own, in which even what takes no time is kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(module, "_WORTH_KEEPING", -1.0)
    module._in_memory.cache_clear()
    return tmp_path / "cache" / "lrf3d"


@pytest.fixture
def bakes(monkeypatch):
    """How many stages have been painted."""
    painted, paint = [], module._paint

    def count(structures, progress):
        painted.append(structures)
        return paint(structures, progress)

    monkeypatch.setattr(module, "_paint", count)
    return painted


def assert_same(one, other):
    places = np.array([[0.0, 0.0], [7.3, -4.1]])
    assert np.array_equal(one.walls.faces.quads, other.walls.faces.quads)
    assert np.array_equal(one.ground.picture, other.ground.picture)
    assert np.array_equal(one.walls.light.ground(places)[0], other.walls.light.ground(places)[0])


def test_a_stage_of_another_process_has_the_same_light_and_gathers_more_of_it():
    stage = stage_of(city_run())
    assert_same(stage, pickle.loads(pickle.dumps(stage)))


def test_a_second_film_of_the_same_walls_bakes_nothing(bakes):
    first = stage_of(city_run())
    module._in_memory.cache_clear()
    assert_same(first, stage_of(city_run()))
    assert len(bakes) == 1


class Evil:
    """A pickle that makes a folder when it is loaded."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (self.folder,)


def test_nothing_in_a_kept_file_is_executed(bakes, cache, tmp_path):
    stage_of(city_run())
    (kept,) = cache.glob("*.stage")
    kept.write_bytes(pickle.dumps((Evil(str(tmp_path / "made")), None)))
    module._in_memory.cache_clear()
    stage_of(city_run())
    assert len(bakes) == 2 and not (tmp_path / "made").exists()


def test_other_walls_are_painted_for_themselves(bakes):
    stage_of(city_run())
    stage_of(city_run((1000.5, 0.0)))
    assert len(bakes) == 2


def test_a_damaged_stage_is_painted_again(cache, bakes):
    stage_of(city_run())
    (kept,) = cache.iterdir()
    kept.write_bytes(kept.read_bytes()[:1000])
    module._in_memory.cache_clear()
    stage_of(city_run())
    assert len(bakes) == 2 and len(list(cache.iterdir())) == 1


def test_where_nothing_can_be_kept_the_stage_is_painted_all_the_same(cache, bakes):
    cache.parent.mkdir()
    cache.touch()
    stage_of(city_run())
    assert len(bakes) == 1


def test_the_stages_used_longest_ago_go_first(tmp_path):
    for number in range(4):
        (tmp_path / f"{number}.stage").write_bytes(b"0123456789")
        os.utime(tmp_path / f"{number}.stage", (number, number))
    assert {file.name for file in module._beyond(tmp_path, 20)} == {"0.stage", "1.stage"}


def test_progress_goes_up_to_all_of_it():
    steps = []
    stage_of(city_run(), lambda done, total: steps.append(done / total))
    assert steps == sorted(steps) and steps[-1] == 1.0 and 0.0 < steps[0] < 1.0


@pytest.mark.parametrize("renderer", ["embree", pytest.param("gl", marks=pytest.mark.gl)])
def test_a_film_takes_the_stage_that_it_is_given(bakes, renderer):
    from lrf3d.render.film import Film

    run = city_run()
    stage = stage_of(run)
    module._in_memory.cache_clear()
    shape = {"size": (64, 36), "view": "chase", "samples": 0, "renderer": renderer}
    given, own = (Film(run, **shape, stage=each).draw(1.0).copy() for each in (stage, None))
    assert np.array_equal(given, own) and len(bakes) == 1
