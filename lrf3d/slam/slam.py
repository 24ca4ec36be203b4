"""Slam: poses and map from scans and odometry increments alone, current after every scan.

A scan and how the robot moved since the last one by its wheels enter; the front end places it, key
scans look for loops, and where one closes the pose graph is optimised.
"""

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser import LaserScan
from lrf3d.laser.range_finder import beam_directions
from lrf3d.slam.closures import Closure, Key, LoopCloser
from lrf3d.slam.frames import between, compose
from lrf3d.slam.front_end import KEY_DISTANCE, KEY_TURN, FrontEnd, Tracked
from lrf3d.slam.pose_graph import Edges, optimised
from lrf3d.slam.surface import surface_of

EDGE_SHARE = 0.3
"""Share of the matching's information that counts for the edge between key scans: neighbours are
matched with the same local map, and share its errors."""

NEWS = 3.0
"""A closure that is off by less than this many deviations waits for the next optimisation."""


class Slam:
    def __init__(self, *, laser_offset: float = 0.0, key_distance: float = KEY_DISTANCE,
                 key_turn: float = KEY_TURN) -> None:
        self._laser = np.array([laser_offset, 0.0])
        self.front = FrontEnd(key_distance=key_distance, key_turn=key_turn)
        self.closer = LoopCloser()
        self.tracked: list[Tracked] = []
        self.keys_poses = np.empty((0, 3))
        self.edges = Edges.none()
        self.poses_of_scans: list[Float] = []
        self._covariance = np.zeros((3, 3))

    def update(self, scan: LaserScan, odometry: Float) -> None:
        hits = scan.hits
        points = scan.ranges[hits, None] * beam_directions(0.0, scan.angles[hits]) + self._laser
        surface = surface_of(points, self._laser)
        tracked = self.front.track(surface, np.asarray(odometry, dtype=np.float64))
        self._covariance += self.front.wheels.covariance(odometry)
        self.tracked.append(tracked)
        self.poses_of_scans.append(tracked.pose)
        if self.front.key_due():
            self._add_key(scan, surface, tracked)

    def _add_key(self, scan: LaserScan, surface: Float, tracked: Tracked) -> None:
        self.front.add_key(surface)
        key = Key(len(self.tracked) - 1, tracked.pose, surface, scan.angles, scan.ranges, self._laser)
        keys = self.closer.keys
        if keys:
            relative = between(keys[-1].pose, key.pose)
            new = compose(self.keys_poses[-1], relative)
            wheels = np.linalg.inv(self._covariance)
            information = EDGE_SHARE * tracked.information + wheels
            from lrf3d.slam.frames import turned
            information = turned(information, float(relative[2]))
            count = len(keys)
            self.edges = self.edges + Edges(np.array([count - 1]), np.array([count]), relative[None], information[None], np.array([False]))
        else:
            new = tracked.pose
        self._covariance = np.zeros((3, 3))
        self.keys_poses = np.vstack([self.keys_poses, new])
        self.closer.add_key(key)
        if keys[:-1]:
            closures = self.closer.search(self.keys_poses)
            if closures:
                more = closure_edges(closures)
                self.edges = self.edges + more
                if (more.squares(self.keys_poses) > NEWS**2).any():
                    self.keys_poses = optimised(self.keys_poses, self.edges, 3)

    def finish(self) -> None:
        self.keys_poses = optimised(self.keys_poses, self.edges, 20)


def closure_edges(closures: list[Closure]) -> Edges:
    """Closures as edges of the pose graph."""
    return Edges(
        np.array([closure.old for closure in closures]),
        np.array([closure.new for closure in closures]),
        np.array([closure.relative for closure in closures]),
        np.array([closure.information for closure in closures]),
        np.ones(len(closures), np.bool_),
    )
