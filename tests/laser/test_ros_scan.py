import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lrf3d
from lrf3d import InputError, LaserRangeFinder, LaserScan
from lrf3d.laser import Stamp

FANS = st.tuples(st.floats(-math.pi, math.pi), st.floats(0.01, math.pi), st.integers(2, 4000)).map(
    lambda fan: LaserRangeFinder(fan[0], fan[0] + fan[1], fan[2])
)


def scan_of(ranges, **settings):
    angles = np.linspace(-1, 1, len(ranges))
    return LaserScan((0, 0, 0), angles, ranges, **{"range_max": 20.0, **settings})


RANGES = st.one_of(st.floats(0.125, 20, width=32), st.sampled_from([np.inf, -np.inf]))


@given(FANS)
def test_the_angles_fit_together_in_float32(lrf):
    told = LaserScan((0, 0, 0), lrf.angles, np.ones(lrf.beams)).as_ros()
    first, last, apart = (told[f"angle_{name}"] for name in ("min", "max", "increment"))
    low, high, step = map(np.float32, (first, last, apart))
    assert (float(low), float(high), float(step)) == (first, last, apart)
    assert high == low + np.float32(lrf.beams - 1) * step
    # slam_toolbox and its like count the beams from the angles.
    assert round((last - first) / apart) + 1 == lrf.beams
    # The first angle, the step and their sum are rounded to float32, the step once for each beam.
    rounding = float(np.spacing(np.float32(max(abs(lrf.angle_min), abs(lrf.angle_max)))))
    assert last == pytest.approx(lrf.angle_max, abs=rounding * (lrf.beams + 1))


def test_the_fields_are_those_of_ros():
    names = (
        "header angle_min angle_max angle_increment time_increment scan_time range_min"
        " range_max ranges intensities"
    )
    told = scan_of([1.0, 2.0], time=3.25, time_increment=0.001, range_min=0.1)
    message = told.as_ros("front", scan_time=0.1)
    assert list(message) == names.split()
    assert message["header"] == {"stamp": {"sec": 3, "nanosec": 250_000_000}, "frame_id": "front"}
    assert message["ranges"].dtype == message["intensities"].dtype == np.float32
    assert message["scan_time"] == float(np.float32(0.1))
    assert message["range_min"] == float(np.float32(0.1))


def test_no_return_is_told_after_rep_117():
    told = scan_of([0.05, 0.1, 19.5, 20.5, np.inf, -np.inf], range_min=0.1).as_ros()
    assert told["ranges"].tolist() == [-np.inf, np.float32(0.1), 19.5, np.inf, np.inf, -np.inf]
    message = {**scan_of([1.0], range_min=0.1).as_ros(), "ranges": [float("nan")]}
    assert message["angle_increment"] == 0.0
    assert LaserScan.from_ros(message).ranges.tolist() == [np.inf]


@given(st.lists(RANGES, min_size=2))
def test_what_goes_out_comes_back(ranges):
    scan = scan_of(ranges, range_min=0.0625, time=12.125, time_increment=0.25)
    fields = scan.as_ros()
    stamp = SimpleNamespace(**fields["header"]["stamp"])
    message = SimpleNamespace(**fields | {"header": SimpleNamespace(stamp=stamp)})
    for told in (fields, message):
        back = LaserScan.from_ros(told, pose=(1, 2, 3))
        assert np.array_equal(back.ranges, scan.ranges)
        assert back.angles == pytest.approx(scan.angles, abs=1e-6)
        assert (back.range_min, back.range_max) == (0.0625, 20.0)
        assert (back.time, back.time_increment) == (12.125, 0.25)
        assert back.pose == (1, 2, 3)
        again = back.as_ros()
        assert np.array_equal(again["ranges"], fields["ranges"])
        assert again["header"] == fields["header"]


@given(st.floats(0, 1e6))
def test_a_time_is_told_to_the_nanosecond(time):
    stamp = Stamp.of(time)
    assert 0 <= stamp.nanosec < 10**9
    assert abs(stamp.seconds - time) <= 1e-9
    assert Stamp.of(stamp.seconds) == stamp


def test_a_range_that_a_driver_leaves_at_0_is_unknown():
    message = {**scan_of([1.0, 30.0]).as_ros(), "ranges": [1.0, 30.0], "range_max": 0.0}
    assert LaserScan.from_ros(message).ranges.tolist() == [1.0, 30.0]


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [
        ("angle_min", np.nan, "apart"),
        ("angle_min", np.inf, "apart"),
        ("range_max", -1.0, "range_max"),
        ("range_max", "far", "LaserScan"),
        ("ranges", None, "without ranges"),
        ("header", {}, "LaserScan"),
    ],
)
def test_a_message_that_makes_no_sense_is_refused(field, value, said):
    message = {**scan_of([1.0, 2.0]).as_ros(), field: value}
    with pytest.raises(InputError, match=said):
        LaserScan.from_ros(message)
    with pytest.raises(InputError, match="LaserScan"):
        LaserScan.from_ros(object())


def test_intensities_go_out_and_come_back():
    world = lrf3d.World([[3, -5, 3, 5]], materials=["brick"])
    scan = lrf3d.PlanarCaster(world).cast(lrf3d.LaserRangeFinder(beams=31), (0, 0, 0))
    message = scan.as_ros()
    assert message["intensities"].dtype == np.float32
    back = lrf3d.LaserScan.from_ros(message)
    assert (back.intensities == scan.intensities.astype(np.float32)).all()
    # Some drivers send none, or fewer than ranges, and some loggers have no such field.
    fields = dict(message)
    for sent in (np.empty(0, np.float32), message["intensities"][:5], None):
        fields["intensities"] = sent
        if sent is None:
            del fields["intensities"]
        assert lrf3d.LaserScan.from_ros(fields).intensities is None
