import numpy as np
import pytest

from lrf3d import load_scenario
from lrf3d.errors import InputError
from lrf3d.laser import imperfect
from lrf3d.world.schema import read_settings

ROOM = """\
[[object]]
points = [[0, 0], [10, 0], [10, 8], [0, 8]]
closed = true

[robot]
route = [[2, 2], [8, 2]]
speed = 2.0
scan_interval = 0.5

[laser]
beams = 61
range_max = 20.0
range_min = 0.2
scan_duration = 0.1

[noise]
sigma = 0.05
constant = 0.02
resolution = 0.01
drop_outs = 0.1

[[obstacle]]
route = [[5, 4], [9, 4]]
speed = 1.5
radius = 0.3
"""


@pytest.fixture
def room(tmp_path):
    path = tmp_path / "room.toml"
    path.write_text(ROOM)
    return path


def test_a_file_says_what_the_range_finder_does_and_what_moves(room):
    scenario = load_scenario(room)
    assert scenario.lrf.range_min == 0.2 and scenario.lrf.scan_duration == 0.1
    assert scenario.sigmas == (0.05,)
    assert scenario.noise == imperfect(0.05, constant=0.02, resolution=0.01, drop_outs=0.1)
    trajectory = scenario.trajectory()
    (obstacle,) = scenario.obstacles
    assert np.hypot(*obstacle.outline.T).min() >= 0.3
    assert obstacle.path.at(np.array([1.0]))[0] == pytest.approx([6.5, 4, 0])
    run = scenario.run(drive=trajectory, rng=0)
    returned = np.isfinite(run.ranges)
    assert run.ranges[returned] == pytest.approx(np.round(run.ranges[returned], 2), abs=1e-9)
    assert 0.05 < 1.0 - returned.mean() < 0.15
    assert ((run.walls == -1) & np.isfinite(run.truth)).any()


def test_settings_hold_instead_of_what_the_file_says(room):
    scenario = load_scenario(
        room, ["laser.range_max=12", "noise.resolution=0.0", "noise.sigma=[0.01, 0.02]"]
    )
    assert scenario.lrf.range_max == 12.0 and scenario.lrf.beams == 61
    assert scenario.noise == imperfect(0.01, constant=0.02, drop_outs=0.1)
    assert scenario.sigmas == (0.01, 0.02)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("laser.range_mx=2", "did you mean 'range_max'"),
        ("lasr.range_max=2", "did you mean 'laser'"),
        ("noise.dropouts=0.1", "did you mean 'drop_outs'"),
        ("range_max=2", "TABLE.KEY=VALUE"),
        ("laser.range_max=far", "'far': expected a finite number, above 0"),
        ("robot.route=[[1, 2], [3", "not a TOML value; expected one such as 20"),
        ("laser.beams=5\nrange_max=1", "whole number"),
        ("mapper.mode=papr", "expected one of paper, robust, found 'papr'"),
        ("laser." + "a" * 1_000_000 + "=1", "known are"),
        ("noise.drop_outs=2", "at most 1"),
    ],
)
def test_a_setting_that_is_none_is_answered_with_what_is_meant(text, said):
    with pytest.raises(InputError, match="setting") as error:
        read_settings([text])
    assert said in str(error.value) and "\n" not in str(error.value)
    assert len(str(error.value)) < 1000


def test_a_text_needs_no_quotes_and_a_number_no_leading_nought():
    texts = ["mapper.mode=paper", "noise.sigma=.04", 'film.view="front door"', "robot.speed=2."]
    assert read_settings(texts) == {
        "mapper": {"mode": "paper"},
        "noise": {"sigma": 0.04},
        "film": {"view": "front door"},
        "robot": {"speed": 2.0},
    }
    assert read_settings(["film.view=front door"])["film"]["view"] == "front door"
