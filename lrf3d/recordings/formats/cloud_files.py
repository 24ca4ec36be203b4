"""Clouds of a run as files: PLY, PCD and LAS of all points, KITTI and arrays scan by scan.

A run with a lidar enters; its scans are cast again one by one, so that memory holds only one. Only
the points of the first lidar are written, with times since the start of the run.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lrf3d.base.errors import InputError, MissingLibraryError, OutputError
from lrf3d.base.files import replacing, unfinished_folder, writing
from lrf3d.base.units import MILLI
from lrf3d.geometry.lines import Records
from lrf3d.laser import LidarScan
from lrf3d.messages.clouds import POINT, records_of
from lrf3d.recordings.formats.npz import write_npz
from lrf3d.simulation.run import Run

# A point without gaps between its fields, as in files.
PACKED = np.dtype([(name, POINT[name]) for name in POINT.names or ()])

# The same for PLY, of whose types Open3D does not know ushort.
PLY = np.dtype([(name, "<i4" if name == "ring" else POINT[name]) for name in POINT.names or ()])

# The types of a point's fields in PLY.
PLY_TYPES = {"<f4": "float", "<i4": "int"}


def write_ply(run: Run, path: Path) -> None:
    """Write all points in the world to a binary PLY file."""
    rows = "\n".join(f"property {PLY_TYPES[PLY[name].str]} {name}" for name in PLY.names or ())
    head = "ply\nformat binary_little_endian 1.0\nelement vertex {count:<12}\n"
    _write_all(run, path, f"{head}{rows}\nend_header\n", PLY)


def write_pcd(run: Run, path: Path) -> None:
    """Write all points in the world to a binary PCD file."""
    names = PACKED.names or ()
    kinds = [PACKED[name] for name in names]
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\nSIZE {' '.join(str(kind.itemsize) for kind in kinds)}\n"
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}\nCOUNT{' 1' * len(names)}\n"
        "WIDTH {count:<12}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count:<12}\nDATA binary\n"
    )
    _write_all(run, path, head, PACKED)


def _write_all(run: Run, path: Path, head: str, kind: "np.dtype[np.void]") -> None:
    """Write a header, in which the number of points is filled in, and the points of a kind."""
    scans = _records(run, path, local=False)
    with replacing(path) as unfinished, unfinished.open("wb") as file:
        file.write(head.format(count=0).encode())
        count = 0
        for _, rows in scans:
            file.write(rows.astype(kind).tobytes())
            count += len(rows)
        file.seek(0)
        file.write(head.format(count=count).encode())


def write_kitti(run: Run, path: Path) -> None:
    """Write the folder of a KITTI odometry sequence: scans in the lidar's frame, times, poses."""
    if path.exists():
        raise OutputError(f"{path}: exists; choose another folder")
    with writing(path), unfinished_folder(path) as place:
        folder = place / path.name
        (folder / "velodyne").mkdir(parents=True)
        poses = []
        for number, (scan, rows) in enumerate(_records(run, path, local=True)):
            points = np.column_stack([rows[name] for name in ("x", "y", "z", "intensity")])
            points.astype("<f4").tofile(folder / "velodyne" / f"{number:06}.bin")
            _, _, z, _, pitch, roll = scan.lidar.mount
            axes = Rotation.from_euler("ZYX", [scan.pose.theta, pitch, roll]).as_matrix()
            poses.append(np.column_stack([axes, [scan.pose.x, scan.pose.y, z]]))
        np.savetxt(folder / "times.txt", run.trajectory.times - run.trajectory.times[0], "%.9f")
        np.savetxt(folder / "poses.txt", np.array(poses).reshape(-1, 12), "%.12g")
        folder.rename(path)


def write_las(run: Run, path: Path) -> None:
    """Write all points in the world to a LAS file, in millimetres, by laspy."""
    try:
        import laspy
    except ImportError:
        raise MissingLibraryError(f"{path}: LAS needs laspy: pip install 'lrf3d[las]'") from None
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.scales = np.full(3, MILLI)
    header.offsets = np.append(np.floor(run.trajectory.poses[0, :2]), 0.0)
    header.add_extra_dim(laspy.ExtraBytesParams("ring", np.uint16))
    scans = _records(run, path, local=False)
    with (
        replacing(path) as unfinished,
        unfinished.open("wb") as file,
        laspy.open(file, mode="w", header=header, closefd=False) as writer,
    ):
        for _, rows in scans:
            points = laspy.ScaleAwarePointRecord.zeros(len(rows), header=header)
            points.x, points.y, points.z = (rows[name].astype(np.float64) for name in "xyz")
            # By the standard the largest intensity is 65,535: a white wall at 1 m, or brighter.
            points.intensity = np.minimum(rows["intensity"], 1.0) * 65_535
            points.gps_time = rows["time"]
            points.ring = rows["ring"]
            points.return_number[:] = points.number_of_returns[:] = 1
            writer.write_points(points)


def write_arrays(run: Run, path: Path) -> None:
    """Write points in the lidar's frame as arrays, with the first row of each scan."""
    scans = [rows for _, rows in _records(run, path, local=True)]
    rows = np.concatenate(scans)
    arrays = {name: np.ascontiguousarray(rows[name]) for name in POINT.names or ()}
    arrays["starts"] = np.cumsum([0, *map(len, scans)])
    arrays["times"] = run.trajectory.times
    arrays["poses"] = run.trajectory.poses
    write_npz(path, arrays)


def _records(run: Run, path: Path, *, local: bool) -> Iterator[tuple[LidarScan, Records]]:
    """The scans, and the points of each."""
    if not run.cloud_sensors.lidars:
        raise InputError(f"{path}: the run has no lidar; give its world one, [lidar]")
    for scan in run.lidar_scans:
        rows = records_of(scan, local=local)
        rows["time"] += 0.0 if local else scan.time - float(run.trajectory.times[0])
        yield scan, rows
