"""Recorder: makes a run of a loop of one's own, to be filmed, scored and saved as any other.

Scans enter one by one, in a loop that casts, decides, moves and maps as it likes; a Run leaves.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from lrf3d.casting.dynamic_obstacle import DynamicObstacle
from lrf3d.errors import InputError, each_of, expect, shown
from lrf3d.geometry import Float, number
from lrf3d.laser import LaserRangeFinder, LaserScan
from lrf3d.laser.range_finder import lasers_of
from lrf3d.mapping import LineMap
from lrf3d.pose import as_pose
from lrf3d.robot import EstimatedTrajectory, Trajectory
from lrf3d.robot.following import SCAN_INTERVAL
from lrf3d.run import Run, is_snapshot
from lrf3d.world import World


class Recorder:
    """Keeps the scans and maps of a loop.

    Args:
        world: The walls.
        lrf: The laser range finder, or several.
        obstacles: The dynamic obstacles, for pictures and films.

    Examples:
        >>> import lrf3d
        >>> room, lrf = lrf3d.load_world("paper_room"), lrf3d.LaserRangeFinder()
        >>> caster, mapper = lrf3d.EmbreeCaster(room), lrf3d.LineMapper()
        >>> recorder = lrf3d.Recorder(room, lrf)
        >>> for x in (1.0, 1.5, 2.0):
        ...     scan = caster.cast(lrf, (x, 1, 0))
        ...     mapper.update(scan)
        ...     recorder.add(scan, map=mapper.map)
        >>> run = recorder.run()
        >>> len(run), run.trajectory.length, len(run.map) > 0
        (3, 1.0, True)
    """

    def __init__(
        self,
        world: World,
        lrf: LaserRangeFinder | Sequence[LaserRangeFinder],
        *,
        obstacles: Sequence[DynamicObstacle] = (),
    ) -> None:
        expect(world, World, "recorder: world")
        self._world, self._lasers = world, lasers_of(lrf)
        self._obstacles = tuple(each_of(obstacles, DynamicObstacle, "recorder: obstacle"))
        self._times, self._poses = list[float](), list[Any]()
        self._columns: dict[str, list[Float]] = {name: [] for name in ("ranges", "truth", "walls")}
        self._maps, self._estimates = dict[int, LineMap](), list[Any]()

    def __len__(self) -> int:
        return len(self._times)

    def add(
        self,
        scan: LaserScan | Sequence[LaserScan],
        *,
        map: LineMap | None = None,
        truth: LaserScan | Sequence[LaserScan] | None = None,
        estimate: Sequence[float] | Float | None = None,
        time: float | None = None,
    ) -> None:
        """Add a scan, whose pose is the true one of its laser.

        Args:
            scan: The measured scan, or those of all lasers at one moment.
            map: The map after it.
            truth: The same without noise; the measured one if not given.
            estimate: The robot's estimate of its pose, for every scan or none.
            time: Time [s]; if not given that of the scan, or 0.25 s after the last where it is not
                later.

        Raises:
            InputError: It is no scan of these lasers, the map is no LineMap, or the time is not
                later than that of the last scan.
        """
        scans, true = self._scans(scan), self._scans(scan if truth is None else truth)
        if map is not None:
            expect(map, LineMap, "recorder: map")
        last = self._times[-1] if self._times else -np.inf
        if time is None:
            time = scans[0].time if scans[0].time > last else last + SCAN_INTERVAL
        elif number(time, "recorder: time", "seconds", least=-1e12) <= last:
            raise InputError(f"recorder: time {time:g} s; expected one after {last:g} s")
        if self._times and (estimate is None) != (not self._estimates):
            raise InputError("recorder: estimate: give one for every scan or for none")
        if estimate is not None:
            self._estimates.append(as_pose(estimate))
        if map is not None:
            self._maps[len(self)] = map
        self._times.append(float(time))
        self._poses.append(scans[0].robot)
        for name, parts in (("ranges", scans), ("truth", true), ("walls", true)):
            values = [getattr(each, name.replace("truth", "ranges")) for each in parts]
            self._columns[name].append(np.concatenate(values))

    def run(self) -> Run:
        """The run so far.

        Raises:
            InputError: There is no scan in it.
        """
        if not len(self):
            raise InputError("recorder: no scans; add(scan) first")
        kept = {scan: self._maps[scan] for scan in self._maps if is_snapshot(scan, len(self))}
        if self._maps:
            newest = max(self._maps)
            kept[newest] = self._maps[newest]
        estimate = None
        if self._estimates:
            none = np.empty(0, np.int64), np.empty((0, 3, 3))
            estimate = EstimatedTrajectory(np.array(self._estimates), *none)
        columns: dict[str, Any] = {name: np.array(rows) for name, rows in self._columns.items()}
        poses = np.array(self._poses)
        poses[:, 2] = np.unwrap(poses[:, 2])
        return Run(
            self._world,
            self._lasers[0],
            Trajectory(self._times, poses),
            **columns,
            snapshot_scans=tuple(sorted(kept)),
            maps=tuple(kept[scan] for scan in sorted(kept)),
            obstacles=tuple(each.until(self._times[-1]) for each in self._obstacles),
            estimate=estimate,
            further=self._lasers[1:],
        )

    def _scans(self, given: Any) -> tuple[LaserScan, ...]:
        """Scans of these lasers, one of each."""
        scans = (given,) if isinstance(given, LaserScan) else given
        scans = tuple(each_of(scans, LaserScan, "recorder: scan"))
        beams = [each.beams for each in self._lasers]
        if beams != [len(each.ranges) for each in scans]:
            raise InputError(f"recorder: {shown(given)}: expected a scan of {beams} beams")
        return scans
