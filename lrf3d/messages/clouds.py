"""Clouds and depth images as ROS 2 messages, and as records of points."""

from collections.abc import Iterable, Iterator

import numpy as np

from lrf3d.geometry.lines import Records
from lrf3d.laser import DepthCamera, DepthImage, LidarScan, Stamp
from lrf3d.laser.cloud_sensors import CloudSensors
from lrf3d.messages.ros import BASE, Fields, header_fields, place, turned

CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
CAMERA = "sensor_msgs/msg/CameraInfo"

# Offsets of the fields of a point [bytes].
OFFSETS = [0, 4, 8, 12, 16, 20]

# A point of a cloud [m, m, m, 1, 1, s], as drivers of rotating lidars write it.
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "intensity", "ring", "time"],
        "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
        "offsets": OFFSETS,
        "itemsize": 24,
    }
)

# Types of the fields of points, by the codes of sensor_msgs/PointField, without their byte order.
POINT_FIELDS = dict(enumerate(("i1", "u1", "i2", "u2", "i4", "u4", "f4", "f8"), 1))

# The codes of these types.
DATATYPES = {f"<{kind}": code for code, kind in POINT_FIELDS.items()}

# From a camera's frame, x ahead, to its optical frame, z ahead and y down.
OPTICAL = {"x": -0.5, "y": 0.5, "z": -0.5, "w": 0.5}

# The axes of an optical frame in the camera's frame.
OPTICAL_AXES = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def records_of(scan: LidarScan, *, local: bool = True) -> Records:
    """The points (m,) of a scan, of kind POINT, in the lidar's frame or in the world."""
    points = scan.points(local=local)
    rows = np.zeros(len(points), POINT)
    rows["x"], rows["y"], rows["z"] = points.T
    rows["intensity"] = scan.intensities[scan.hits]
    rows["ring"] = scan.rings
    rows["time"] = scan.times
    return rows


def point_cloud(scan: LidarScan, stamp: Stamp, frame: str) -> Fields:
    """A scan as sensor_msgs/PointCloud2, in the frame of the lidar."""
    rows = records_of(scan)
    columns = [
        {"name": name, "offset": offset, "count": 1, "datatype": DATATYPES[POINT[name].str]}
        for name, offset in zip(POINT.names or (), OFFSETS, strict=True)
    ]
    return {
        "header": header_fields(stamp, frame),
        "height": 1,
        "width": len(rows),
        "fields": columns,
        "point_step": POINT.itemsize,
        "row_step": POINT.itemsize * len(rows),
        "data": rows.view(np.uint8),
        "is_dense": True,
    }


def depth_image(image: DepthImage, stamp: Stamp, frame: str) -> Fields:
    """A depth image as sensor_msgs/Image in metres; by REP 118 depths below the least are −inf."""
    height, width = image.depth.shape
    return {
        "header": header_fields(stamp, frame),
        "height": height,
        "width": width,
        "encoding": "32FC1",
        "step": 4 * width,
        "data": np.ascontiguousarray(image.depth, dtype="<f4").ravel().view(np.uint8),
    }


def camera_info(camera: DepthCamera, stamp: Stamp, frame: str) -> Fields:
    """A camera as sensor_msgs/CameraInfo: a pinhole without distortion."""
    f = camera.focal_length
    middle_x = 0.5 * (camera.width - 1)
    middle_y = 0.5 * (camera.height - 1)
    return {
        "header": header_fields(stamp, frame),
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": [f, 0.0, middle_x, 0.0, f, middle_y, 0.0, 0.0, 1.0],
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [f, 0.0, middle_x, 0.0, 0.0, f, middle_y, 0.0, 0.0, 0.0, 1.0, 0.0],
    }


def cloud_topics(sensors: CloudSensors) -> dict[str, str]:
    """The topics of sensors, without a namespace, and their types."""
    found = {f"{lidar.name}/points": CLOUD for lidar in sensors.lidars}
    for camera in sensors.depth_cameras:
        found[f"{camera.name}/depth/image_raw"] = IMAGE
        found[f"{camera.name}/depth/camera_info"] = CAMERA
    return found


def cloud_messages(
    scans: Iterable[LidarScan], images: Iterable[DepthImage], stamp: Stamp, prefix: str = ""
) -> Iterator[tuple[str, Fields]]:
    """The messages of scans and depth images with their topics, in frames with a prefix."""
    for scan in scans:
        name = scan.lidar.name
        yield f"{name}/points", point_cloud(scan, stamp, prefix + name)
    for image in images:
        camera = image.camera
        frame = optical(prefix + camera.name)
        yield f"{camera.name}/depth/image_raw", depth_image(image, stamp, frame)
        yield f"{camera.name}/depth/camera_info", camera_info(camera, stamp, frame)


def mount_transforms(sensors: CloudSensors, stamp: Stamp, prefix: str = "") -> list[Fields]:
    """The transforms of sensors on their robot, and of the optical frames of cameras."""
    found = []
    for each in sensors:
        x, y, z, *turns = each.mount
        turn = quaternion(*turns)
        found.append(turned(stamp, prefix + BASE, prefix + each.name, place(x, y, z), turn))
    for camera in sensors.depth_cameras:
        name = prefix + camera.name
        found.append(turned(stamp, name, optical(name), place(0.0, 0.0), OPTICAL))
    return found


def optical(name: str) -> str:
    """The optical frame of a camera."""
    return f"{name}_optical"


def quaternion(yaw: float, pitch: float, roll: float) -> dict[str, float]:
    """The quaternion of a roll, then a pitch, then a yaw [rad]."""
    # Most messages have no cloud, and need not wait for it.
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_quat()
    return dict(zip("xyzw", turn.tolist(), strict=True))
