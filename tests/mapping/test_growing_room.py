"""A map has room for more when it needs it, and is the same as one that had room from the start."""

import numpy as np
import pytest

import lrf3d
from lrf3d.mapping import live_map
from lrf3d.mapping.paper import growing
from lrf3d.mapping.robust import (
    evidence_grid,
    mapper,
    object_groups,
    refinement,
    segment_pool,
    wall_store,
)

ROOM = {
    "walls": [(wall_store, "LEAST_ROWS")],
    "stamps": [(refinement, "LEAST_ROWS"), (mapper, "LEAST_ROWS")],
    "segments": [(segment_pool, "LEAST_ROWS")],
    "objects": [(object_groups, "LEAST_ROWS")],
    "shown segments": [(live_map, "LEAST_ROWS")],
    "links": [(object_groups, "LEAST_LINKS")],
    "blocks": [(evidence_grid, "LEAST_BLOCKS")],
    "planes": [(evidence_grid, "LEAST_PLANES")],
    "clusters": [(evidence_grid, "LEAST_CLUSTERS")],
    "paper": [(growing, "LEAST_ROWS")],
}
"""What has room, and the constants that say for how much at first."""

LEAST = {
    "walls": 2, "stamps": 2, "segments": 2, "objects": 2, "shown segments": 2, "links": 64,
    "blocks": 8,
}  # fmt: skip


@pytest.fixture(scope="module")
def scans():
    """A town in which walls come, are joined and go; one scan sees many at once."""
    rng = np.random.default_rng(4)
    places = np.array([[x, y] for x in range(0, 30, 5) for y in range(0, 30, 5)], dtype=float)
    places = places[(places != 15.0).any(axis=1)] + rng.uniform(-1, 1, (35, 2))
    corners = places[:, None] + np.array([[0, 0], [2, 0.3], [1.7, 2.2], [-0.2, 2]])
    walls = np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)
    caster = lrf3d.PlanarCaster(lrf3d.World(walls))
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi, beams=181, range_max=12.0)
    poses = [(15 + 3 * np.cos(t), 15 + 3 * np.sin(t), t) for t in np.linspace(0, 6, 30)]
    noise = lrf3d.ProportionalNoise(0.03)
    return [noise(caster.cast(lrf, pose), rng) for pose in poses]


def mapped(scans, mode, *, resumed_at=-1):
    """The map after each scan; before one of them another mapper goes on from the state."""
    line_mapper, maps = lrf3d.LineMapper(mode), []
    for index, scan in enumerate(scans):
        if index == resumed_at:
            state, line_mapper = line_mapper.state(), lrf3d.LineMapper(mode)
            line_mapper.restore(state)
        line_mapper.update(scan)
        maps.append((line_mapper.map.segments.copy(), line_mapper.map.objects.copy()))
    return maps


@pytest.fixture(scope="module")
def with_room(scans):
    return {mode: mapped(scans, mode) for mode in ("robust", "paper")}


@pytest.mark.parametrize("resumed_at", [-1, 9])
@pytest.mark.parametrize("what", [*ROOM, "all"])
def test_a_map_that_grows_is_the_same_as_one_that_has_room(
    what, resumed_at, scans, with_room, monkeypatch
):
    for name in ROOM if what == "all" else [what]:
        for module, constant in ROOM[name]:
            monkeypatch.setattr(module, constant, LEAST.get(name, 4))
    mode = "paper" if what == "paper" else "robust"
    for (segments, objects), (known, numbers) in zip(
        mapped(scans, mode, resumed_at=resumed_at), with_room[mode], strict=True
    ):
        assert np.array_equal(segments, known)
        assert np.array_equal(objects, numbers)
