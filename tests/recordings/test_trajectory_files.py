import numpy as np
import pytest

from lrf3d.base.errors import InputError
from lrf3d.recordings.formats.trajectory import load_relations, save_tum


def test_relations_are_read_with_and_without_their_certainty(written):
    path = written("a.relations", "# a b dx dy dtheta certain\n3 5 0.1 -0.2 1.5 0\n\n5 9 1 2 3\n")
    known = load_relations(path)
    assert known.first.tolist() == [3, 5] and known.second.tolist() == [5, 9]
    assert known.relative.tolist() == [[0.1, -0.2, 1.5], [1.0, 2.0, 3.0]]
    assert known.certain.tolist() == [False, True]


@pytest.mark.parametrize(
    "line",
    [
        *("1 2 3", "1 2 x 0 0", "1.5 2 0 0 0", "-1 2 0 0 0", "1 2 nan 0 0", "1 inf 0 0 0"),
        *("1e21 3 0 0 0", f"{2**63} 3 0 0 0"),
    ],
)
def test_a_line_that_is_no_relation_is_named(tmp_path, line):
    path = tmp_path / "a.relations"
    for text, said in (
        (f"1 2 0 0 0\n{line}\n", ":2: expected two line"),
        ("# \n", ": no relation"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=rf"a\.relations{said}"):
            load_relations(path)


def test_a_trajectory_is_written_as_position_and_unit_quaternion(tmp_path):
    path = tmp_path / "a.tum"
    poses = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, np.pi / 2]])
    save_tum(np.array([976052857.337555, 976052858.0]), poses, path)
    rows = np.loadtxt(path)
    assert rows[:, 0].tolist() == [976052857.337555, 976052858.0]
    assert rows[1, 1:4].tolist() == [3.0, 4.0, 0.0]
    assert rows[1, 4:] == pytest.approx([0, 0, np.sqrt(0.5), np.sqrt(0.5)], abs=1e-8)
