"""Reading logs: the name of a file or a folder selects the reader."""

from pathlib import Path

from lrf3d.errors import InputError
from lrf3d.files import own_name
from lrf3d.io.laser_log import LaserLog
from lrf3d.world import world_names

CARMEN_ENDINGS = (".log", ".log.gz", ".clf", ".clf.gz")
"""Endings of CARMEN logs; the last two are what the University of Freiburg calls them."""

BAG_ENDINGS = (".mcap", ".db3", ".bag")
"""Endings of the files of ROS bags; the last one is that of ROS 1."""

POSES = ("auto", "truth", "tf", "odom")
"""Where the poses of a log may come from."""


def is_run(name: str) -> bool:
    """Whether a name is that of a run, a ``.npz`` or a folder, and not of a world.

    A built-in world comes before a folder of the same name, as everywhere.
    """
    if name in world_names():
        return False
    return Path(name).is_dir() or Path(name).suffix.lower() == ".npz"


def odometry_of(path: str | Path) -> str:
    """The source of poses for SLAM: a bag may know the truth, CARMEN keeps the odometry apart."""
    return "auto" if str(path).lower().endswith(CARMEN_ENDINGS) else "odom"


def load_log(
    path: str | Path,
    *,
    largest_range: float | None = None,
    poses: str = "auto",
    scan_topic: str | None = None,
    part: int | None = None,
) -> LaserLog:
    """Read the scans of a log; the ending of its name gives the format.

    Args:
        path: A CARMEN log, gzipped or not; a ROS bag, as .mcap, .db3, .bag or a folder; or
            a run.npz or its folder.
        largest_range: Least reading that means no return [m]; if not given, that of the range
            finder, or the largest reading where it stands out.
        poses: Source of the poses: ``auto`` for the best that the format has, or ``truth``, ``tf``
            or ``odom``.
        scan_topic: Bags: the topic of the scans; if not given, those of all lasers of the robot
            of ``/scan``, or of the first one.
        part: Bags whose stamps go back: the part that is read, from 1; the longest if not given.

    Raises:
        InputError: The file cannot be read, has an unknown format, or holds no scan.
        MissingLibraryError: A bag needs rosbags, which is not installed.

    Examples:
        >>> import lrf3d
        >>> room = lrf3d.load_world("paper_room")
        >>> run = lrf3d.simulate(room, [(1, 1, 0), (2, 1, 0)], rng=0)
        >>> lrf3d.export_run(run, "carmen", "drive.log")
        >>> log = lrf3d.load_log("drive.log")
        >>> len(log.scans), log.scans[0].pose.x
        (2, 1.0)
    """
    path = Path(path)
    if largest_range is not None and not largest_range > 0.0:
        raise InputError(f"largest range {largest_range}: expected metres, more than 0")
    if poses not in POSES:
        raise InputError(f"poses from {poses!r}: expected one of {', '.join(POSES)}")
    ending = path.name.lower()
    if ending.endswith(CARMEN_ENDINGS):
        from lrf3d.io.carmen import load_carmen

        return load_carmen(path, largest_range=largest_range, poses=poses)
    if ending.endswith(".npz") or (path / "run.npz").exists():
        from lrf3d.io.run_file import load_run

        if poses not in ("auto", "truth"):
            raise InputError(f"{path}: no poses from {poses} in it; a run has only true poses")
        run = load_run(path)
        # Another name than the run's, so that its map does not replace that of the run.
        name = own_name(path.resolve().parent if path.name == "run.npz" else path)
        return LaserLog(f"{name}_map", list(run.scans), source="the run")
    if ending.endswith(BAG_ENDINGS) or path.is_dir():
        from lrf3d.io.bag_reader import load_bag

        return load_bag(
            path, largest_range=largest_range, poses=poses, scan_topic=scan_topic, part=part
        )
    known = ", ".join((*CARMEN_ENDINGS, *BAG_ENDINGS, ".npz"))
    raise InputError(f"{path}: not a log by its name; expected a folder or an ending of {known}")
