"""Bags of point clouds are read as scans, whatever the layout of their points."""

import base64
import json
import struct

import numpy as np
import pytest
from bags import STORE, header, transform, wheels, write

import lrf3d
from lrf3d import InputError, load_log
from lrf3d.apps.cli.inputs import read_log
from lrf3d.apps.cli.parser import parse
from lrf3d.laser.unrolling import unrolled
from lrf3d.messages.clouds import CLOUD, POINT_FIELDS, quaternion
from lrf3d.messages.ros import TRANSFORMS, made
from lrf3d.recordings.formats.bags.clouds import cloud_points
from lrf3d.recordings.formats.bags.files import BagTopic
from lrf3d.recordings.formats.bags.livox import livox_cloud

ROOM = lrf3d.World([[-4, -3, 5, -3], [5, -3, 5, 4], [5, 4, -4, 4], [-4, 4, -4, -3]])
RINGS = lrf3d.Lidar(np.radians([-8.0, 0.0, 8.0]), columns=180, mount=(0, 0, 0.8))
CODES = {kind: code for code, kind in POINT_FIELDS.items()}


def cast(pose, lidar=RINGS):
    return lrf3d.PlanarCaster(ROOM).cast_lidar(lidar, pose)


def cloud(scan, stamp, kinds, *, order="<", pad=0, row_pad=0, rows=1, ring="ring", **fields):
    """A scan as a message: kinds are the types of x, y, z; fields are further ones."""
    points = scan.points(local=True)
    columns = dict(zip("xyz", zip(kinds.split(), points.T, strict=True), strict=True))
    if ring:
        columns[ring] = "u2", scan.rings
    columns |= fields
    form = np.dtype([(name, order + kind) for name, (kind, _) in columns.items()])
    layout = {"names": form.names, "formats": [form[name] for name in form.names],
              "offsets": [form.fields[name][1] for name in form.names],
              "itemsize": form.itemsize + pad}  # fmt: skip
    table = np.zeros(len(points), np.dtype(layout))
    for name, (_, values) in columns.items():
        table[name] = values
    data = table.view(np.uint8).reshape(rows, -1)
    data = np.pad(data, ((0, 0), (0, row_pad)))
    described = [
        {"name": name, "offset": layout["offsets"][k], "count": 1,
         "datatype": CODES.get(form[name].str[1:], 99)}
        for k, name in enumerate(form.names)
    ]  # fmt: skip
    return {
        "header": header(stamp, "lidar"), "height": rows, "width": len(points) // rows,
        "fields": described, "is_bigendian": order == ">", "point_step": form.itemsize + pad,
        "row_step": data.shape[1], "data": data.ravel(), "is_dense": True,
    }  # fmt: skip


def bag(path, *clouds, mount=(0, 0, 0.8), turn=(0, 0, 0, 1), frame="lidar"):
    sent = [("/points", float(t), CLOUD, made(STORE, CLOUD, each)) for t, each in enumerate(clouds)]
    static = "/tf_static", 0.0, TRANSFORMS, transform(0.0, "base_link", frame, mount, turn)
    return write(path, static, *wheels(max(len(clouds), 2)), *sent)


LAYOUTS = {
    "float": {"kinds": "f4 f4 f4"},
    "double": {"kinds": "f8 f8 f8"},
    "big-endian": {"kinds": "f4 f4 f4", "order": ">"},
    "padded": {"kinds": "f4 f8 f4", "pad": 7, "row_pad": 5},
    "organised": {"kinds": "f4 f4 f4", "rows": 3, "row_pad": 4},
    "capitals": {"kinds": "f4 f4 f4", "ring": "", "Ring": ("f4", np.repeat([0, 1, 2], 180))},
    "channel": {"kinds": "f4 f4 f4", "ring": "channel", "intensity": ("f4", np.nan)},
}


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_the_level_ring_of_a_cloud_is_the_planar_scan(layout, tmp_path):
    planar = lrf3d.PlanarCaster(ROOM).cast(RINGS.planar, (0, 0, 0))
    log = load_log(bag(tmp_path / "b", cloud(cast((0, 0, 0)), 0.0, **layout)))
    (scan,) = log.scans
    order = np.argsort(scan.angles)
    assert np.allclose(np.sort(scan.angles), RINGS.planar.angles, atol=1e-6)
    assert np.allclose(scan.ranges[order], planar.ranges, rtol=1e-6)
    assert "ring 1 of 3, 0.0° above the level" in log.notes[0]
    assert "180 of 540 points used; left out: 360 points of another ring" in log.notes[0]


@pytest.mark.parametrize("known", [True, False])
def test_a_band_of_heights_is_in_the_frame_of_the_robot_if_its_mount_is_known(known, tmp_path):
    message = cloud(cast((0, 0, 0)), 0.0, "f4 f4 f4", ring="")
    message["data"] = np.concatenate([message["data"], np.full(12, 255, np.uint8)])
    message["width"] += 1
    message["row_step"] += 12
    sent = bag(tmp_path / "b", message, frame="lidar" if known else "camera")
    # The beams down meet walls 3 to 6 m away by 0.4 to 0.9 m lower than the lidar.
    log = load_log(sent, height=(-0.01, 0.75) if known else (-0.81, -0.05))
    scan = cast((0, 0, 0))
    lower = scan.points()[scan.rings == 0]
    shown = log.scans[0].points()
    assert set(map(tuple, shown.round(4))) == set(map(tuple, lower[:, :2].round(4)))
    assert "invalid point" in log.notes[0]
    above = "above base_link" if known else "above the lidar, whose mount is unknown"
    assert above in log.notes[0]


@pytest.mark.parametrize(
    "mount",
    [(0.3, 0.0, 0.8, 0.4, 0.35, 0.0), (0.3, 0.0, 0.8, 0.4, 0.0, np.pi)],
    ids=["tilted", "hanging"],
)
def test_a_tilted_or_hanging_lidar_is_made_level(mount, tmp_path):
    lidar = lrf3d.Lidar(np.radians(np.linspace(-25, 25, 26)), columns=360, mount=mount)
    message = cloud(cast((0.3, 0.0, 0.4), lidar), 0.0, "f4 f4 f4")
    turn = [quaternion(*mount[3:])[axis] for axis in "xyzw"]
    log = load_log(bag(tmp_path / "b", message, mount=mount[:3], turn=turn), height=(0.7, 0.9))
    points = log.scans[0].points()
    near = np.stack([points[:, 0] + 4, points[:, 0] - 5, points[:, 1] + 3, points[:, 1] - 4])
    assert len(points) > 100
    assert np.abs(near).min(axis=0).max() < 1e-4


@pytest.mark.parametrize("name", ["line", "intensity"])
def test_without_rings_far_walls_are_seen_and_no_floor(name, tmp_path):
    hall = lrf3d.World([[-25, -25, 25, -25], [25, -25, 25, 25], [25, 25, -25, 25],
                        [-25, 25, -25, -25]])  # fmt: skip
    lidar = lrf3d.Lidar(np.radians(np.linspace(-11.5, 11.5, 24)), columns=720, mount=(0, 0, 0.3))
    scan = lrf3d.PlanarCaster(hall).cast_lidar(lidar, (0, 0, 0))
    # Each line of a rosette is level on average, and has points of all heights.
    mixed = np.random.default_rng(0).integers(4, size=len(scan.rings))
    log = load_log(
        bag(tmp_path / "b", cloud(scan, 0.0, "f4 f4 f4", ring="", **{name: ("u1", mixed)}))
    )
    assert "points within 0.2 m of the lidar's height, or up to 1.2° above it" in log.notes[0]
    assert "720 beams" in log.notes[0]
    assert 25 - 1e-5 < log.scans[0].ranges.min() and log.scans[0].ranges.max() < 36


# Names of times, with their types, the number of their unit in a second, and their beginning [s].
CLOCKS = {
    "time": ("f4", 1.0, 0.0),
    "before": ("f4", 1.0, -0.08),
    "t": ("u4", 1e9, 0.0),
    "offset_time": ("u4", 1e6, 0.0),
    "timestamp": ("f8", 1.0, 1.0),
    "timestamps": ("f8", 1e9, 0.0),
}


@pytest.mark.parametrize("clock", CLOCKS.values(), ids=CLOCKS)
@pytest.mark.parametrize("way", [1, -1])
def test_beams_are_unrolled_by_the_times_of_points(way, clock, tmp_path):
    kind, unit, begins = clock
    name = "time" if begins < 0.0 else next(n for n, c in CLOCKS.items() if c == clock)
    rolling = lrf3d.Lidar([0.0], columns=119, mount=(0, 0, 0.8))
    angles = rolling.planar.angles
    since = np.linspace(0.0, 0.08, 119)[::way]
    begin = begins % 1.0 - (begins < 0.0)
    clouds = []
    for sent in (0.0, 0.5, 1.0, 1.5):
        # The robot drives at 1 m/s along x; each column is cast where it is then.
        x = sent + begin + since - 1.0
        ends = np.where(np.cos(angles) > 0, 5 - x, -4 - x) / np.cos(angles)
        sides = np.where(np.sin(angles) > 0, 4, -3) / np.sin(angles)
        ranges = np.minimum(ends, np.abs(sides))[None]
        moved = lrf3d.LidarScan((0, 0, 0), rolling, ranges, np.zeros_like(ranges, np.int32))
        own = (sent if begins == 1.0 else begins) + since
        clouds.append(cloud(moved, sent, "f4 f4 f4", ring="", **{name: (kind, unit * own)}))
    log = load_log(bag(tmp_path / "b", *clouds, mount=(-1.0, 0.0, 0.8)), height=(0.5, 1.0))
    assert "beams by the times of points" in log.notes[0]
    scan = unrolled(log.scans[-1])
    assert scan.time == pytest.approx(1.5 + begin, abs=1e-3)
    points = scan.points()
    near = np.stack([points[:, 0] + 4, points[:, 0] - 5, points[:, 1] + 3, points[:, 1] - 4])
    assert np.abs(near).min(axis=0).max() < 1e-3


BROKEN = {
    "x, y and z": lambda message: message["fields"].pop(0),
    "shorter than their fields": lambda message: message.update(point_step=9),
    "too few for": lambda message: message.update(width=10_000),
    "has the type 77": lambda message: message["fields"][0].update(datatype=77),
    "without points": lambda message: message.update(width=0, data=message["data"][:0]),
}


@pytest.mark.parametrize("text", BROKEN)
def test_an_unusable_cloud_is_refused_in_one_line(text, tmp_path):
    message = cloud(cast((0, 0, 0)), 0.0, "f4 f4 f4")
    BROKEN[text](message)
    with pytest.raises(InputError, match=text) as caught:
        load_log(bag(tmp_path / "b", message))
    assert "\n" not in str(caught.value)


def test_the_points_of_a_planar_laser_may_be_in_the_frame_of_the_robot(tmp_path):
    level = cast((0, 0, 0), lrf3d.Lidar([0.0], columns=180, mount=(0, 0, 0.8)))
    sent = cloud(level, 0.0, "f4 f4 f4", ring="")
    sent["data"].view(np.float32)[2::3] += 0.8
    log = load_log(bag(tmp_path / "bag", sent, mount=(0, 0, 0)))
    assert len(log.scans[0].points()) == 180
    assert "points within 0.2 m of their height, 0.8 m (or" in log.notes[0]
    # A lidar elsewhere that first meets something flat above it keeps its own height.
    log = load_log(bag(tmp_path / "b", sent, cloud(cast((0, 0, 0)), 1.0, "f4 f4 f4", ring="")))
    assert [int(np.isfinite(scan.ranges).sum()) for scan in log.scans] == [0, 180]


def test_clouds_in_a_fixed_frame_and_without_times_are_named(tmp_path):
    message = cloud(cast((0, 0, 0)), 0.0, "f4 f4 f4", time=("f4", 0.0))
    log = load_log(bag(tmp_path / "b", message))
    assert "all beams at once" in log.notes[0] and not log.scans[0].time_increment
    message["header"]["frame_id"] = "map"
    with pytest.raises(InputError, match="frame map, which is not that of a lidar"):
        load_log(bag(tmp_path / "c", message))
    with pytest.raises(InputError, match="lower one first"):
        load_log(tmp_path / "b", height=(1.0, 0.0))


def test_clouds_of_json_are_read(written):
    fields = cloud(cast((0, 0, 0)), 5.0, "f4 f4 f4")
    fields["data"] = base64.b64encode(fields["data"].tobytes()).decode()
    line = json.dumps({"op": "publish", "topic": "/points", "msg": fields})
    assert len(load_log(written("log.json", line + "\n")).scans[0].points()) == 180


@pytest.mark.parametrize("frame", ["livox_frame", "lidar"])
@pytest.mark.parametrize("aligned", [True, False])
def test_clouds_of_livox_are_unpacked_as_a_whole(frame, aligned):
    name = frame.encode() + b"\0" * aligned
    head = struct.pack("<4x3I", 5, 7, len(name)) + name
    head += bytes(-(len(head) - 4) % 8) * aligned + struct.pack("<QIB3xI", 0, 3, 1, 3)
    points = [struct.pack("<I3f3B", 9 * k, k, -k, 0.5, 1, 2, k) + b"\0" * aligned for k in range(3)]
    data = head + b"".join(points)[: -1 if aligned else None]
    message = livox_cloud(data, CLOUD, aligned=aligned)
    assert (message.header.frame_id, message.header.stamp.nanosec) == (frame, 7)
    places, rings, times = cloud_points(message)
    assert places.tolist() == [[k, -k, 0.5] for k in range(3)]
    assert rings.tolist() == [0, 1, 2] and times.tolist() == [0, 9, 18]
    with pytest.raises(InputError, match="too few for 3 points"):
        livox_cloud(data[:-20], CLOUD, aligned=aligned)
    topic = BagTopic.of("/livox/lidar", "livox_ros_driver2/CustomMsg", "cdr")
    assert (topic.kind, topic.packing) == (CLOUD, "livox cdr")


def test_a_drive_with_a_lidar_maps_to_the_walls_of_the_planar_scans(tmp_path):
    scenario = lrf3d.load_scenario("paper_room")
    lrf = lrf3d.LaserRangeFinder(-np.pi, np.pi * (1 - 2 / 360), 360, range_max=50.0)
    lidar = lrf3d.Lidar(np.radians([-10.0, 0.0, 10.0]), columns=360, range_max=50.0)
    run = scenario.run(lrf=lrf, lidars=lidar, sigma=0.0, rng=0, snapshots=1)
    lrf3d.export_run(run, "mcap", tmp_path / "drive.mcap")
    found = []
    for words in ([], ["--scan-topic", "/lidar/points"], ["--height", "0.4,0.6"]):
        log = read_log(parse(["map", str(tmp_path / "drive.mcap"), *words]))
        mapper = lrf3d.LineMapper(sigma=0.01)
        for scan in log.scans:
            mapper.update(scan)
        walls = mapper.map.segments
        found.append(np.concatenate([walls, walls[:, [2, 3, 0, 1]]]))
    below = parse(["map", "drive.mcap", "--height", "-0.2,0.6"]).height
    assert below == (-0.2, 0.6)
    for walls in found[1:]:
        # Ends follow the noise, which a laser has at a range_max that clouds do not name.
        assert len(walls) == len(found[0])
        assert np.abs(found[0][:, None] - walls).max(axis=2).min(axis=1).max() < 0.1
