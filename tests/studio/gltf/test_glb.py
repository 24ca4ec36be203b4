"""Runs and worlds as GLB: valid to the Khronos validator, and true to the run at every time."""

from dataclasses import replace

import numpy as np
import pygltflib
import pytest
from estimates import estimated
from khronos import faults, needs_validator
from program import refused, told
from test_render import city_run, run_of

from lrf3d import (
    DynamicObstacle,
    InputError,
    LaserRangeFinder,
    LineMap,
    Trajectory,
    World,
    export_run,
    load_scenario,
    save_run,
    save_world,
)
from lrf3d.casting.dynamic_obstacle import round_outline
from lrf3d.studio.gltf import run_glb
from lrf3d.studio.scene.marks import DrawnEstimate
from lrf3d.studio.scene.timeline import Timeline, interpolated

FAR = (85_000.0, 447_500.0)


def simulated(name, every):
    """A built-in world, driven; each scan of so many is taken."""
    scenario = load_scenario(name, ["laser.beams=61"])
    drive = scenario.trajectory()
    drive = replace(drive, times=drive.times[::every], poses=drive.poses[::every])
    return scenario.run(drive=drive, rng=3)


RUNS = {
    "city": lambda: simulated("city", 40),
    "paper_room": lambda: simulated("paper_room", 1),
    "without a map": lambda: replace(city_run(), snapshot_scans=(), maps=()),
    "of an empty map": lambda: replace(city_run(), maps=(LineMap.empty(),)),
    "with obstacles": lambda: replace(
        city_run(),
        obstacles=(DynamicObstacle(round_outline(0.4), Trajectory([0.0], [(-20, 3, 1)])),),
    ),
    "of one scan": lambda: city_run().part(np.array([0])),
    "far away": lambda: city_run(FAR),
    "with an estimate": lambda: estimated(city_run()),
    "of one beam": lambda: one_beam_run(),
    "that sees nothing": lambda: run_of(
        World([[0, 0, 1, 0]]), [0, 1, 2], [(9, 9, 0), (9, 10, 1), (9, 11, 2)], range_max=2.0
    ),
}


def one_beam_run():
    run = city_run()
    lrf = LaserRangeFinder(angle_min=0.0, angle_max=0.0, beams=1, range_max=run.lrf.range_max)
    beam = np.s_[:, 45:46]
    return replace(
        run, lrf=lrf, ranges=run.ranges[beam], truth=run.ranges[beam], walls=run.walls[beam]
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("glb")
    made = {}
    for name, make in RUNS.items():
        run = make()
        made[name] = run, folder / f"{name}.glb"
        export_run(run, "glb", made[name][1])
    return made


@needs_validator
@pytest.mark.slow
def test_the_khronos_validator_finds_no_fault_in_runs(files):
    assert faults(*(path for _, path in files.values())) == []


@needs_validator
def test_the_khronos_validator_finds_no_fault_in_worlds(tmp_path):
    paths = [tmp_path / f"{name}.glb" for name in ("city", "corridor", "paper_room")]
    for path in paths:
        save_world(load_scenario(path.stem).world, path)
    assert faults(*paths) == []


class Glb:
    """A GLB file as arrays."""

    def __init__(self, data):
        self.gltf = pygltflib.GLTF2.load_from_bytes(data)
        self.blob = self.gltf.binary_blob()
        channels = self.gltf.animations[0].channels if self.gltf.animations else []
        self.channels = {(c.target.node, c.target.path): c.sampler for c in channels}

    def array(self, number):
        accessor = self.gltf.accessors[number]
        view = self.gltf.bufferViews[accessor.bufferView]
        kinds = {5126: np.float32, 5121: np.uint8, 5123: np.uint16, 5125: np.uint32}
        columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor.type]
        start = view.byteOffset + accessor.byteOffset
        kind = kinds[accessor.componentType]
        flat = np.frombuffer(self.blob, kind, accessor.count * columns, start)
        return flat.reshape(accessor.count, columns)

    def nodes(self, group):
        """Numbers of the nodes in a group."""
        return next(node.children for node in self.gltf.nodes if node.name == group)

    def node(self, name):
        return next(i for i, node in enumerate(self.gltf.nodes) if node.name == name)

    def value(self, node, path, time):
        """What a player shows at a time: the node's own, or what the animation gives."""
        if (node, path) not in self.channels:
            default = {"scale": [1, 1, 1], "translation": [0, 0, 0]}.get(path)
            return np.array(getattr(self.gltf.nodes[node], path) or default, float)
        sampler = self.gltf.animations[0].samplers[self.channels[node, path]]
        times, values = self.array(sampler.input)[:, 0], self.array(sampler.output)
        if sampler.interpolation == "STEP":
            return values[max(0, np.searchsorted(times, time, side="right") - 1)]
        return np.array([np.interp(time, times, column) for column in values.T])

    def pose(self, node, time):
        """Where a node stands on the ground at a time, and how it is turned."""
        x, y, _ = self.value(node, "translation", time)
        _, _, sine, cosine = self.value(node, "rotation", time)
        return np.array([x, y, 2.0 * np.arctan2(sine, cosine)])

    def positions(self, node, part=0):
        mesh = self.gltf.meshes[self.gltf.nodes[node].mesh]
        return self.array(mesh.primitives[part].attributes.POSITION)

    def following(self, mesh, node):
        """The corners, in the frame of a node, and the colours of what follows it in a mesh."""
        skinned = self.gltf.nodes[self.node(mesh)]
        columns = self.gltf.meshes[skinned.mesh].primitives[0].attributes
        own = self.array(columns.JOINTS_0)[:, 0] == self.gltf.skins[skinned.skin].joints.index(node)
        return self.array(columns.POSITION)[own], self.array(columns.COLOR_0)[own]


def seen(glb, group, time):
    """The nodes of a group that have a size at a time."""
    return [node for node in glb.nodes(group) if glb.value(node, "scale", time).max() > 0.0]


@pytest.mark.slow
@pytest.mark.parametrize("offset", [(0.0, 0.0), FAR])
def test_robot_and_obstacles_move_as_in_the_run_wherever_the_world_lies(offset):
    off = np.array([*offset, 0.0])
    path = Trajectory([0.5, 2.0, 3.0], np.add(off, [(-22, 1, 3.0), (-14, -1, -3.0), (-14, 3, 1.0)]))
    standing = Trajectory([0.0], np.add(off, [(-20, 3, 1)]))
    obstacles = tuple(DynamicObstacle(round_outline(0.4), way, 1.8) for way in (path, standing))
    run = replace(city_run(offset), obstacles=obstacles)
    glb = Glb(run_glb(run))
    origin = np.array([*glb.gltf.nodes[0].extras["origin"], 0.0])
    moving = {"robot": run.trajectory, "obstacle 0": path, "obstacle 1": standing}
    for name, way in moving.items():
        node = glb.node(name)
        assert name == "robot" or glb.positions(node)[:, 2].max() == pytest.approx(1.8, abs=0.01)
        for time in np.linspace(0.0, Timeline(run).end, 23):
            apart = glb.pose(node, time) - (way.at(np.array([time]))[0] - origin)
            assert apart[:2] == pytest.approx([0.0, 0.0], abs=1e-4)
            # Players go round the circle from key to key; here the way is cut straight.
            assert np.cos(apart[2]) > 0.99


@pytest.mark.parametrize("every", [1, 3])
def test_one_scan_is_seen_at_a_time_and_it_is_the_nearest(every):
    run = city_run()
    glb = Glb(run_glb(run, every=every))
    times = run.trajectory.times[::every]
    assert len(glb.nodes("beams")) == len(times)
    with pytest.raises(InputError, match="every 0"):
        run_glb(run, every=0)
    for time in np.linspace(0.01, times[-1] - times[0] - 0.01, 37):
        (node,) = seen(glb, "beams", time)
        nearest = int(np.abs(times - times[0] - time).argmin()) * every
        assert glb.gltf.nodes[node].name == f"scan {nearest}"


@pytest.mark.slow
def test_hits_lie_on_the_points_that_the_scan_met():
    run = city_run(FAR)
    glb = Glb(run_glb(run))
    for index in (0, len(run) - 1):
        points = run.scan(index).points() - run.world.origin
        places = glb.following("all hits", glb.node(f"scan {index}"))[0][:, :2]
        off = np.hypot(*(places[:, None] - points).T)
        # A mark of 8 cm stands before the wall by 2 cm, so that both never share a pixel.
        assert off.min(axis=1).max() < 0.1


def test_what_many_nodes_show_is_drawn_at_once_and_equal_arrays_are_kept_once():
    glb = Glb(run_glb(simulated("paper_room", 1)))
    shown = [node.mesh for node in glb.gltf.nodes if node.mesh is not None]
    assert sum(len(glb.gltf.meshes[mesh].primitives) for mesh in shown) < 60
    assert len(glb.gltf.nodes) > 60
    kept = [(glb.blob[v.byteOffset :][: v.byteLength], v.target) for v in glb.gltf.bufferViews]
    assert len(set(kept)) == len(kept)


@pytest.mark.slow
def test_everything_has_the_light_of_the_film_and_needs_no_lamp():
    gltf = Glb(run_glb(city_run())).gltf
    assert gltf.extensionsUsed == ["KHR_materials_unlit"]
    assert all("KHR_materials_unlit" in material.extensions for material in gltf.materials)


def test_the_map_grows_and_ends_as_the_map_of_the_run():
    run = simulated("paper_room", 1)
    glb = Glb(run_glb(run))
    begins = run.trajectory.times[list(run.snapshot_scans)] - run.trajectory.times[0]
    for begin, stage in zip(begins, run.maps, strict=True):
        (node,) = seen(glb, "map", begin + 1e-3)
        corners, colours = glb.following("all maps", node)
        ends = (stage.segments - np.tile(run.world.origin, 2)).reshape(-1, 2)
        assert np.hypot(*(corners[:, None, :2] - ends).T).min(axis=1).max() < 0.1
        tints = len(np.unique(colours, axis=0))
        assert tints <= len(stage.segments)
    # What the first scan finds at once has one colour.
    assert tints > 1


@pytest.mark.slow
def test_the_trail_follows_the_robot():
    run = city_run()
    glb = Glb(run_glb(run))
    timeline = Timeline(run)
    for time in np.linspace(0.3, timeline.end - timeline.start, 9):
        ends = []
        for node in glb.nodes("trail"):
            length, (x, y, turn) = glb.value(node, "scale", time)[0], glb.pose(node, time)
            if length > 0.0:
                ends.append([x + length * np.cos(turn), y + length * np.sin(turn)])
        pose = timeline.poses(np.array([timeline.start + time]))[0, :2] - run.world.origin
        assert np.hypot(*(np.array(ends) - pose).T).min() < 0.05


@pytest.mark.slow
def test_the_estimate_stands_where_the_robot_believed_itself_to_be():
    run = estimated(city_run())
    timeline = Timeline(run, playback=1.0)
    glb = Glb(run_glb(run))
    drawn = DrawnEstimate.from_timeline(timeline)
    node = glb.node("ellipse of now")
    for time in (0.0, 1.0, 3.3, 4.0):
        place = glb.value(node, "translation", time)
        due = interpolated(np.array([time]), drawn.keys.times, drawn.keys.poses)[0, :2]
        assert place[:2] == pytest.approx(due, abs=1e-4)
    # The longer axis of the last ellipse lies along x.
    assert glb.value(node, "scale", 4.0)[:2] == pytest.approx(np.diag(drawn.shapes[-1]), rel=1e-4)
    assert np.abs(glb.value(node, "rotation", 4.0)[2]) == pytest.approx(0.0, abs=1e-6)
    kept = glb.nodes("ellipses")
    assert len(kept) == len(drawn.kept)
    assert [glb.value(each, "scale", 4.0).max() for each in kept] == [1.0] * len(kept)
    assert glb.value(kept[-1], "scale", 0.0).max() == 0.0
    assert {"trail", "estimate"} <= {each.name for each in glb.gltf.nodes}
    alone = Glb(run_glb(estimated(city_run(), (0.0, 0.0, 0.0))))
    assert "trail" not in {each.name for each in alone.gltf.nodes}


@pytest.mark.slow
def test_the_command_writes_the_file_and_refuses_a_file_that_is_not_a_run(tmp_path):
    run = city_run()
    save_run(run, tmp_path / "run.npz")
    size = told("export", tmp_path, "--to", "glb", "--every", "2")["bytes"]
    data = (tmp_path / "run.glb").read_bytes()
    assert data == run_glb(run, every=2) and size == len(data)
    (tmp_path / "run.npz").write_bytes(b"PK\x03\x04" + bytes(100))
    said = refused("export", tmp_path, "--to", "glb", "--out", tmp_path / "other.glb")
    assert "run.npz" in said and not (tmp_path / "other.glb").exists()
