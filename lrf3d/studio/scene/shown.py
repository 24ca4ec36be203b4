"""Shown: what a scene asks of a recorded run or of a drive that goes on, and of nothing else.

A :class:`~lrf3d.simulation.run.Run` has these attributes, and so does a drive by hand.
"""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

from lrf3d.geometry.lines import Float
from lrf3d.laser import DepthImage, LaserRangeFinder, LaserScan, LidarScan
from lrf3d.mapping import LineMap
from lrf3d.robot import EstimatedTrajectory
from lrf3d.world import World
from lrf3d.world.cameras import FilmPlan

if TYPE_CHECKING:
    from lrf3d.casting.dynamic_obstacle import DynamicObstacle


class ScanPath(Protocol):
    """Where a robot scanned."""

    @property
    def times(self) -> Float:
        """Times (k,) of the scans [s]."""

    @property
    def poses(self) -> Float:
        """Poses (k, 3) of the robot at the scans, in the world."""

    def at(self, times: Float, /) -> Float:
        """Poses (m, 3) of the robot at times (m,) [s]."""


class Shown(Hashable, Protocol):
    """A run or a drive, as scenes, cameras and marks see it."""

    @property
    def world(self) -> World:
        """The walls, and the cameras of the world."""

    @property
    def obstacles(self) -> "tuple[DynamicObstacle, ...]":
        """What moves besides the robot."""

    @property
    def radius(self) -> float:
        """Radius of the robot [m]."""

    @property
    def lasers(self) -> tuple[LaserRangeFinder, ...]:
        """All range finders of the robot; the map is drawn at the height of the first."""

    @property
    def film(self) -> FilmPlan:
        """The default settings of its film."""

    @property
    def playback(self) -> float:
        """Seconds of the run in a second of the film, if no other number is asked for."""

    @property
    def trajectory(self) -> ScanPath:
        """Where the robot scanned."""

    @property
    def knows_truth(self) -> bool:
        """Whether the trajectory is the true one, and the walls are those of the world."""

    @property
    def estimate(self) -> EstimatedTrajectory | None:
        """Where the robot believed that it was at its scans, if it was not given its poses."""

    @property
    def attitudes(self) -> Float | None:
        """Pitch and roll (k, 2) of the robot at the scans [rad]; None on even ground."""

    def scans_at(self, number: int, /) -> tuple[LaserScan, ...]:
        """The scans of all range finders by their number."""

    def clouds(self, number: int, /) -> tuple[Iterator[LidarScan], Iterator[DepthImage]]:
        """The scans of all lidars and the images of all depth cameras at a scan; none of most."""

    def snapshot_after(self, scan: int, /) -> int:
        """The number of the newest map snapshot without any scan after this one; −1 for none."""

    @property
    def maps(self) -> Sequence[LineMap] | Mapping[int, LineMap]:
        """The map snapshots, by their number."""
