"""Known keys: the key scans of a run, with which another drive's are matched."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lrf3d.geometry.lines import Float, Int
from lrf3d.geometry.pose import between, compose
from lrf3d.matching.key_scans import Key, ScanConverter
from lrf3d.matching.search import Place, Submap
from lrf3d.simulation.run import Run
from lrf3d.slam.front_end import KEY_DISTANCE, KEY_TURN
from lrf3d.slam.motion import size_of


@dataclass(frozen=True, eq=False)
class KnownKeys:
    """Key scans (k,) at poses (k, 3), with the numbers (k,) of their scans in a run."""

    keys: list[Key]
    poses: Float = field(repr=False)
    numbers: Int

    @classmethod
    def from_run(cls, run: Run) -> "KnownKeys":
        """The key scans of a run, at its poses, true or estimated."""
        poses = run.trajectory.poses
        chosen = [0]
        for number in range(1, len(run)):
            length, turn = size_of(between(poses[chosen[-1]], poses[number]))
            if length >= KEY_DISTANCE or turn >= KEY_TURN:
                chosen.append(number)
        converter = ScanConverter()
        keys = [converter.candidate(run.scans_at(number), number) for number in chosen]
        return cls(keys, poses[chosen], np.array(chosen))

    @cached_property
    def _seen(self) -> Float:
        """The positions of the key scans, and the middles of their hits (k, 4) [m]."""
        middles = [_middle(key, pose) for key, pose in zip(self.keys, self.poses, strict=True)]
        return np.column_stack([self.poses[:, :2], np.array(middles)])

    def around(self, scan: Key, pose: Float) -> Int:
        """The indices of the key scans whose view overlaps most with a scan's from a pose (3,)."""
        apart = np.abs(self._seen - [*pose[:2], *_middle(scan, pose)]).sum(axis=1)
        nearest_keys = 6  # Number of nearest key scans by which a place is judged.
        return np.argsort(apart, kind="stable")[:nearest_keys]

    def judged(self, scan: Key, guess: Float, prior: Float) -> Place | None:
        """Match a scan near a guess (3,) and judge the place; None if there is no match."""
        near = self.around(scan, guess)
        around = Submap([self.keys[k] for k in near.tolist()], self.poses[near])
        match = around.match(scan, guess, prior)
        return None if match is None else around.place(scan, match)


def _middle(scan: Key, pose: Float) -> Float:
    """The middle (2,) of the hits of a scan from a pose (3,)."""
    x, y = (scan.hits[name].mean() if len(scan.hits) else 0.0 for name in "xy")
    return compose(pose, np.array([x, y, 0.0]))[:2]
