import numpy as np

from lrf3d.world import World
from lrf3d.world.extrude import extrude

WORLD = World(
    [
        [85000, 447500, 85010, 447500],
        [85010, 447500, 85010, 447508],
        [85003, 447520, 85001, 447522],
    ],
    heights=[4.0, 9.0, 2.5],
)


def test_wall_i_is_the_triangles_2i_and_2i_plus_1() -> None:
    mesh = extrude(WORLD)
    assert len(mesh.faces) == 2 * len(WORLD.segments)
    for wall, (segment, height) in enumerate(zip(WORLD.segments, WORLD.heights, strict=True)):
        corners = mesh.triangles[2 * wall : 2 * wall + 2].reshape(-1, 3)
        ends = segment.reshape(2, 2) - WORLD.origin
        expected = {(*end, z) for end in map(tuple, ends) for z in (0.0, height)}
        assert {tuple(corner) for corner in corners} == expected


def test_a_wall_has_the_area_of_its_length_and_height() -> None:
    length = np.hypot(*(WORLD.segments[:, 2:] - WORLD.segments[:, :2]).T)
    area = extrude(WORLD).area_faces.reshape(-1, 2).sum(axis=1)
    np.testing.assert_allclose(area, length * WORLD.heights, rtol=1e-12)
