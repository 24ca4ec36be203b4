"""Run: the input and the results of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from lrf3d.base.errors import InputError, MissingLibraryError, expect, index_of, shown
from lrf3d.base.lazy import ABOVE, Pictured
from lrf3d.geometry.lines import Float, Int, Value, number, numbers, sealed, whole_number
from lrf3d.geometry.pose import as_pose
from lrf3d.laser import DepthImage, LaserRangeFinder, LaserScan, LidarScan
from lrf3d.laser.cloud_sensors import NO_SENSORS, CloudSensors
from lrf3d.laser.scan import LIGHT, returned
from lrf3d.laser.unrolling import unrolled
from lrf3d.mapping import LineMap
from lrf3d.mapping.tracking import ObjectTracker, numbers_by_truth
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.attitude import LEVEL
from lrf3d.robot.kinematics import RADIUS
from lrf3d.robot.odometry import ImuRecord
from lrf3d.world import World
from lrf3d.world.cameras import USUAL_FILM, FilmPlan
from lrf3d.world.free_cells import FreeCells
from lrf3d.world.pieces import joined_objects

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle
    from lrf3d.simulation.clouds import Clouds, RobotState

# Largest number of map snapshots of a run by default: enough for a film, and each takes the mapper
# some hundredths of a second.
MAP_SNAPSHOTS = 100

# What a run has of each scan, and what it may have of the robot's motion at each.
SCANS = ("ranges", "truth", "walls")
MOTION = ("motions", "wheels", "sweeps", "attitudes")


@dataclass(frozen=True, eq=False)
class Run(Value, Pictured):
    """The input and the results of a simulation: all that pictures and films need.

    Args:
        world: The walls.
        lrf: The laser range finder, the first of several.
        trajectory: Times (k,) and poses (k, 3) of the robot at the scans.
        ranges: (k, beams) measured ranges [m], with noise.
        truth: (k, beams) true ranges [m].
        walls: (k, beams) index of the segment that each beam hit, or −1.
        snapshot_scans: Scans after which the map was kept, in ascending order; the last is the last
            scan. Empty if the mapper makes no LineMap.
        maps: The map snapshots: the map after each of these scans.
        obstacles: The dynamic obstacles.
        film: The default settings of its film.
        estimate: The trajectory that the robot estimated; None if its poses were given. In a
            recorded drive, whose truth is unknown, the trajectory has the poses of the estimate.
        intensities: (k, beams) intensities of the measured scans, NaN where a scan of a user's
            caster has none; None in worlds without materials.
        echoes: (k, beams, e) ranges [m] of the echoes of each beam, the nearest first, +inf after
            the last; None if the range finder reports one.
        echo_intensities: (k, beams, e) their intensities.
        radius: Radius of the robot [m].
        further: The other lasers; their beams follow those of the first in each of these arrays.
        motions: (k, lasers, 3) motion of the robot during each scan, see `LaserScan`; None where
            all beams of a scan are sent at once.
        wheels: (k, 3) poses by odometry at the scans, the first as it was; None without odometry.
        imu: What the IMU measured; None without one.
        cloud_sensors: Its lidars and depth cameras. A run keeps no clouds: `lidar` and `depth` cast
            them again, to the last bit.
        sweeps: (k, lidars, 3) motion of the robot during each scan of a lidar; None without any.
        attitudes: (k, 2) its pitch and roll [rad] at the scans; None on even ground.

    Examples:
        >>> import lrf3d
        >>> run = lrf3d.load_scenario("paper_room").run(rng=0)
        >>> len(run), run.ranges.shape, run.scan(1).walls.shape
        (3, (3, 181), (181,))
    """

    world: World
    lrf: LaserRangeFinder
    trajectory: Trajectory
    ranges: Float
    truth: Float
    walls: Int
    snapshot_scans: tuple[int, ...]
    maps: tuple[LineMap, ...]
    obstacles: tuple[DynamicObstacle, ...] = ()
    film: FilmPlan = USUAL_FILM
    estimate: EstimatedTrajectory | None = None
    intensities: Float | None = None
    echoes: Float | None = None
    echo_intensities: Float | None = None
    radius: float = RADIUS
    further: tuple[LaserRangeFinder, ...] = ()
    motions: Float | None = None
    wheels: Float | None = None
    imu: ImuRecord | None = None
    cloud_sensors: CloudSensors = NO_SENSORS
    sweeps: Float | None = None
    attitudes: Float | None = None

    def __post_init__(self) -> None:
        for name, kind in (
            ("world", World), ("lrf", LaserRangeFinder), ("trajectory", Trajectory),
            ("estimate", EstimatedTrajectory | None), ("film", FilmPlan),
        ):  # fmt: skip
            expect(getattr(self, name), kind, f"run: {name}")
        number(self.radius, "run: radius", "metres")
        scans = len(self.trajectory)
        beams = sum(each.beams for each in self.lasers)
        shapes = self._shapes(scans, beams)
        self._hold(*(name for name in shapes if name != "walls"))
        self._hold("walls", dtype=np.int64)
        for name, expected in shapes.items():
            if (found := getattr(self, name).shape) != expected:
                raise InputError(
                    f"run: {name} {found}; expected {expected}, for {scans} poses and {beams} beams"
                )
        if np.isnan(self.ranges).any():
            raise InputError("run: ranges hold NaN; expected metres, or inf where nothing returned")
        snapshots = np.array(self.snapshot_scans, dtype=np.int64)
        ascend = (np.diff(snapshots, prepend=-1, append=scans) > 0).all()
        if snapshots.shape != (len(self.maps),) or not ascend:
            raise InputError(
                f"run: snapshot_scans {shown(self.snapshot_scans)} of {len(self.maps)} maps;"
                f" expected an ascending scan from 0 to {scans - 1} for each"
            )
        if self.estimate is not None and len(self.estimate) != scans:
            raise InputError(f"run: estimate of {len(self.estimate)} scans; expected {scans}")

    def _shapes(self, scans: int, beams: int) -> dict[str, tuple[int, ...]]:
        """The shapes of `rows`."""
        shape = (scans, beams)
        echoes = shape if self.echoes is None else (*shape, *np.shape(self.echoes)[2:3])
        motions = [len(self.lasers), 3], [3], [len(self.cloud_sensors.lidars), 3], [2]
        shapes: dict[str, tuple[int, ...]] = {
            **dict.fromkeys(SCANS, shape), "intensities": shape,
            **dict.fromkeys(("echoes", "echo_intensities"), echoes),
            **{name: (scans, *each) for name, each in zip(MOTION, motions, strict=True)},
        }  # fmt: skip
        return {name: shapes[name] for name in self.rows}

    def __repr__(self) -> str:
        name = f"{self.world.name!r}, " if self.world.name else ""
        return (
            f"Run({name}{len(self)} scans of {self.ranges.shape[1]} beams,"
            f" {self.trajectory.length:.1f} m in {self.trajectory.duration:.1f} s,"
            f" {len(self.map)} segments in {self.map.object_count} objects)"
        )

    def __len__(self) -> int:
        return len(self.trajectory)

    @property
    def lasers(self) -> tuple[LaserRangeFinder, ...]:
        """All laser range finders of the robot."""
        return (self.lrf, *self.further)

    @property
    def rows(self) -> dict[str, Any]:
        """The arrays that it has with a row for each scan, by the names of its attributes."""
        found = {name: getattr(self, name) for name in (*SCANS, *LIGHT, *MOTION)}
        return {name: values for name, values in found.items() if values is not None}

    @property
    def knows_truth(self) -> bool:
        """Whether the trajectory is the true one rather than the estimate of a recorded drive."""
        estimate = self.estimate
        return estimate is None or not np.array_equal(estimate.poses, self.trajectory.poses)

    @property
    def playback(self) -> float:
        """Simulated seconds in a second of its film."""
        return self.film.playback_of(self.trajectory.duration)

    @property
    def odometry(self) -> Float:
        """Poses (k, 3) at the scans by odometry alone; those of the trajectory if it is exact."""
        estimate = self.estimate
        if self.wheels is not None:
            return self.wheels
        if estimate is None or not len(estimate.odometry):
            return self.trajectory.poses
        return estimate.odometry

    @property
    def map(self) -> LineMap:
        """The map after the last scan; an empty one where the mapper makes no LineMap."""
        return self.maps[-1] if self.maps else LineMap.empty()

    def snapshot_after(self, scan: int) -> int:
        """Index of the newest map snapshot without any scan after the given one; −1 for none."""
        return int(np.searchsorted(self.snapshot_scans, scan, side="right")) - 1

    def map_after(self, scan: int) -> LineMap:
        """The newest map snapshot without any scan after the given one."""
        snapshot = self.snapshot_after(whole_number(scan, "scan", least=-1))
        return self.maps[snapshot] if snapshot >= 0 else LineMap.empty()

    @cached_property
    def lasting_objects(self) -> tuple[Int, ...]:
        """For each map snapshot the object (m,) of each segment, with one number in all snapshots.

        If the last map shows a true object, the number is that object's.
        """
        tracker = ObjectTracker()
        tracked = [tracker.follow(line_map) for line_map in self.maps]
        if not tracked:
            return ()
        world = self.world
        known = numbers_by_truth(tracked[-1], self.map, world.segments, joined_objects(world))
        lasting = np.array([known.get(n, -1) for n in range(tracker.count)], np.int64)
        unknown = np.flatnonzero(lasting < 0)
        lasting[unknown] = world.object_count + np.arange(len(unknown))
        return tuple(sealed(lasting[numbers]) for numbers in tracked)

    def part(self, scans: Int) -> Run:
        """The run of some of its scans, in ascending order, with the last of its maps."""
        scans = numbers(scans, "scans")
        if scans.ndim != 1 or scans.dtype.kind not in "iu" or not len(scans):
            raise InputError(f"scans {shown(scans)}: expected some numbers of scans")
        for each in (scans.min(), scans.max()):
            index_of(each, len(self), "scan")
        rows: dict[str, Any] = {name: values[scans] for name, values in self.rows.items()}
        part = replace(
            self,
            trajectory=Trajectory(self.trajectory.times[scans], self.trajectory.poses[scans]),
            snapshot_scans=(len(scans) - 1,) if self.maps else (),
            maps=self.maps[-1:],
            estimate=None if self.estimate is None else self.estimate.part(scans),
            **rows,
        )
        # Its map is that of the whole run, and so are the numbers of the objects in it.
        part.__dict__["lasting_objects"] = self.lasting_objects[-1:]
        return part

    def scan(self, index: int, *, laser: int = 0) -> LaserScan:
        """The measured scan with an index from 0, of one of the lasers by its number."""
        light = {name: values for name, values in self.rows.items() if name in LIGHT}
        return self._scan(index, laser, self.ranges, light)

    def _scan(self, index: int, laser: int, ranges: Float, light: Mapping[str, Float]) -> LaserScan:
        """The scan of a laser with its row of ranges, and of light if there is any."""
        index = index_of(index, len(self), "scan")
        lrf = self.lasers[index_of(laser, len(self.lasers), "laser")]
        begin = sum(each.beams for each in self.lasers[:laser])
        beams = slice(begin, begin + lrf.beams)
        motion = None
        if self.motions is not None and lrf.scan_duration:
            motion = self.motions[index, laser]
        # The arrays of a run are checked.
        scan = LaserScan.unchecked(
            lrf,
            as_pose(lrf.placed(self.trajectory.poses[index])),
            returned(ranges[index, beams], lrf.range_max),
            self.walls[index, beams],
            time=float(self.trajectory.times[index]),
            motion=motion,
        )
        rows: dict[str, Any] = {name: values[index, beams] for name, values in light.items()}
        return replace(scan, **rows) if rows else scan

    def scans_at(self, index: int) -> tuple[LaserScan, ...]:
        """The measured scans with an index from 0, one of each laser."""
        return tuple(self.scan(index, laser=number) for number in range(len(self.lasers)))

    def true_scan(self, index: int, *, laser: int = 0) -> LaserScan:
        """The scan with an index from 0, without noise; intensities are kept of measured ones."""
        return self._scan(index, laser, self.truth, {})

    @cached_property
    def _clouds(self) -> Clouds:
        from lrf3d.simulation.clouds import Clouds

        return Clouds(self.world, self.cloud_sensors, self.obstacles)

    def lidar(self, index: int, *, number: int = 0, noisy: bool = True) -> LidarScan:
        """The scan of a lidar, given by its number, at a scan's index from 0; cast again.

        Examples:
            >>> import lrf3d
            >>> lidar = lrf3d.Lidar.preset("VLP-16", columns=90)
            >>> run = lrf3d.load_scenario("paper_room").run(rng=0, lidars=lidar)
            >>> run.lidar(2).ranges.shape
            (16, 90)
        """
        if not 0 <= number < len(self.cloud_sensors.lidars):
            raise InputError(f"run: lidar {number}: it has {len(self.cloud_sensors.lidars)} lidars")
        return cast(LidarScan, self._clouds.measure(number, self._state(index), noisy=noisy))

    def depth(self, index: int, *, number: int = 0, noisy: bool = True) -> DepthImage:
        """The image of a depth camera, given by its number, at a scan's index; cast again."""
        count = len(self.cloud_sensors.depth_cameras)
        if not 0 <= number < count:
            raise InputError(f"run: depth camera {number}: it has {count} depth cameras")
        number += len(self.cloud_sensors.lidars)
        return cast(DepthImage, self._clouds.measure(number, self._state(index), noisy=noisy))

    @property
    def lidar_scans(self) -> Iterator[LidarScan]:
        """The scans of the first lidar, one by one."""
        return (self.lidar(index) for index in range(len(self)))

    def clouds(self, index: int) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """The scans of all lidars and the images of all depth cameras at a scan's index from 0."""
        return self._clouds.at(self._state(index))

    def _state(self, index: int) -> RobotState:
        """Where the robot is at a scan, and how it moves and is tilted, for casters."""
        from lrf3d.simulation.clouds import RobotState

        path = self.trajectory
        index = index_of(index, len(self), "scan")
        tilt = LEVEL if self.attitudes is None else tuple(self.attitudes[index].tolist())
        sweeps = None if self.sweeps is None else self.sweeps[index]
        return RobotState(path.poses[index], float(path.times[index]), tilt, sweeps)

    def free_cells(self) -> FreeCells:
        """The cells that the measured scans show to be free, for `save_map`."""
        # Reading a world needs no compiled code.
        from lrf3d.laser.free_space import distinct_poses, free_cells

        chosen = distinct_poses(self.trajectory.poses)
        scans = [scan for index in chosen.tolist() for scan in self.scans_at(index)]
        return free_cells([unrolled(scan) for scan in scans])

    def frame(self, time: float, **options: Any) -> NDArray[np.uint8]:
        """One picture (h, w, 3) uint8 of the run's film, at a time [s], row 0 at the top.

        Options are ``size`` (width and height, 1280 × 720), ``view``, ``samples``, ``playback`` and
        ``renderer``; see :func:`lrf3d.render_video`.

        Examples:
            >>> import lrf3d
            >>> run = lrf3d.load_scenario("paper_room").run(rng=0)
            >>> run.frame(0.5, size=(64, 36), renderer="embree").shape
            (36, 64, 3)
        """
        return np.asarray(ABOVE["frame"](self, time, **options))

    def video(self, *, size: tuple[int, int] = (640, 360), **options: Any) -> Any:
        """The run's film as an ``IPython.display.Video``, which a notebook plays in its page.

        The options are those of :func:`lrf3d.render_video`, which writes a film to a file.
        """
        try:
            film = import_module("IPython.display").Video
        except ImportError:
            words = "run.video() is for notebooks and needs IPython: pip install ipython"
            raise MissingLibraryError(words) from None
        with TemporaryDirectory() as folder:
            file = Path(folder) / "run.mp4"
            ABOVE["film"](self, file, size=size, **options)
            settings = {"mimetype": "video/mp4", "html_attributes": "controls loop muted"}
            return film(file.read_bytes(), embed=True, width=size[0], **settings)

    @property
    def true_scans(self) -> Iterator[LaserScan]:
        """The scans without noise, unrolled, in the order of `scans`."""
        for index in range(len(self)):
            for laser in range(len(self.lasers)):
                yield unrolled(self.true_scan(index, laser=laser))

    @property
    def scans(self) -> Iterator[LaserScan]:
        """The measured scans in their order, of each moment those of all lasers."""
        return (scan for index in range(len(self)) for scan in self.scans_at(index))


def is_snapshot(scan: int, scans: int, snapshots: int | None = None) -> bool:
    """Whether the map after a scan is kept: after the last, and evenly before it."""
    most = MAP_SNAPSHOTS if snapshots is None else snapshots
    return (scan + 1) * most // scans > scan * most // scans
