import numpy as np
import pytest

import lrf3d
from lrf3d import InputError, LineMap


@pytest.mark.parametrize(
    ("segments", "objects", "message"),
    [
        ([[0, 0, 1]], [0], r"segments \(1, 3\), objects \(1,\)"),
        ([[0, 0, 1, 0]], [0, 1], r"objects \(2,\) and points \(1,\): expected shapes"),
        ([[0, 0, 1, 0], [0, 0, np.inf, 1]], [0, 1], r"segment 1 is \[.*inf.*\], expected numbers"),
        ([[0, 0, 1.1e9, 0]], [0], r"segment 0 is .* of at most 1e\+09 m"),
        ([[0, 0, 1e300, 0]], [0], r"segment 0 is .* of at most 1e\+09 m"),
    ],
)
def test_an_invalid_map_is_refused(segments, objects, message):
    with pytest.raises(InputError, match=message):
        LineMap(segments, objects, [9] * len(segments))


def test_a_file_of_a_map_out_of_bounds_is_refused_by_name(tmp_path):
    path = tmp_path / "map.geojson"
    lrf3d.save_map(LineMap([[0, 0, 1, 0]], [0], [9]), path)
    path.write_text(path.read_text().replace("1.0, 0.0", "1e300, 0.0"))
    with pytest.raises(InputError, match=r"map.geojson: map: segment 0 is .* of at most 1e\+09 m"):
        lrf3d.load_map(path)


def test_walls_beyond_the_largest_coordinate_are_left_out_of_what_is_mapped():
    laser = lrf3d.LaserRangeFinder(beams=19, range_max=20.0)
    scan = lrf3d.LaserScan((1e9, 0, 0), laser.angles, np.full(19, 5.0), range_max=20.0)
    for mode in ("paper", "robust"):
        mapper = lrf3d.LineMapper(mode)
        mapper.update(scan)
        assert (np.abs(mapper.map.segments) <= 1e9).all()


def test_a_map_is_not_written_under_the_ending_of_another_format(tmp_path):
    with pytest.raises(InputError, match=r"map\.yaml: a map is written as \.geojson"):
        lrf3d.save_map(LineMap.empty(), tmp_path / "map.yaml")
    assert list(tmp_path.iterdir()) == []
