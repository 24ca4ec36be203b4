"""Joining: two drives through the same place in one frame.

The run of a first drive and the solution of a second one enter. The second is located on the map of
the first without an initial guess. Where its key scans match there, ties (closures between the
drives) join both pose graphs, which are optimised as one. The poses of both leave, in one frame.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lrf3d.base.errors import InputError
from lrf3d.geometry.lines import Float, Int, Records
from lrf3d.geometry.pose import bent, between, compose, turned
from lrf3d.matching.key_scans import Key, MixedPixelModel
from lrf3d.simulation.run import Run
from lrf3d.slam import Slam
from lrf3d.slam.checks import COMPARED_WITHIN, LATER, SelfCheck, self_check
from lrf3d.slam.closures import (
    FLOOR,
    LEAST_DISTANCE,
    MATCHING_SHARE,
    Closure,
    closure_edges,
    fixed,
)
from lrf3d.slam.front_end import CERTAIN_SHARE, refined
from lrf3d.slam.places.known_keys import KnownKeys
from lrf3d.slam.places.known_places import KnownPlaces
from lrf3d.slam.places.place_search import Found, PlaceSearch
from lrf3d.slam.pose_graph import edges_of, optimised
from lrf3d.slam.revisits import GUESS_ERROR

# Standard deviations of the pose of a map's key scan relative to its neighbours [m], [m], [rad].
STEP = np.array([0.01, 0.01, 0.003])

# Number of searches for ties. Each starts from where the ties of the last one moved the drive.
ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Joined:
    """Two drives in one frame.

    The first drive has a ``run``, key scans ``keys`` (m,) by number, and ``first_poses`` (n, 3) at
    its scans. The second has ``poses`` (k, 3) of the robot at its scans; it was located from its
    scan ``found_at`` on, with a probability. Ties (c, 2) are pairs of a scan of the first and one
    of the second that show the same place. ``key_scans`` and ``key_poses`` are those of both.
    """

    run: Run
    keys: Int
    first_poses: Float
    poses: Float
    ties: Int
    found_at: int
    probability: float
    key_scans: list[Key] = field(repr=False)
    key_poses: Float
    check: SelfCheck

    def summary(self) -> dict[str, Any]:
        """The figures, in JSON's types."""
        moved = np.hypot(*(self.first_poses - self.run.trajectory.poses)[:, :2].T)
        return {
            "on": self.run.world.name, "scans_before": len(self.run), "found_at": self.found_at,
            "probability": self.probability, "ties": len(self.ties),
            "earlier_poses_moved_m": float(moved.max()),
        }  # fmt: skip


def joined(run: Run, slam: Slam, surfaces: Iterable[Records], poses: Float, name: str) -> Joined:
    """Join a first drive with a second one, which is solved: poses (k, 3) at its scans.

    Raises:
        InputError: The second drive is nowhere on the map of the first with certainty.
    """
    places = KnownKeys.from_run(run)
    numbers = slam.key_scans
    search = PlaceSearch(KnownPlaces.from_run(run))
    for key, number in zip(slam.closer.keys, numbers.tolist(), strict=True):
        search.see(number, key, poses[number])
    search.search()
    # The place where the drive was certain for the most scans comes first.
    found = sorted(search.found, key=lambda each: len(each.path), reverse=True)
    sure = [each for each in found if each.path]
    nodes, ties = _tied(places, slam, poses, sure) if sure else (places.poses, [])
    if not ties:
        raise InputError(
            f"{name}: found nowhere on the map of {run.world.name} with certainty (the likeliest"
            f" place has a probability of {search.probability:.2g}); no map is made"
        )
    count = len(places.keys)
    first = _moved(run.trajectory.poses, places.numbers, places.poses, nodes[:count])
    second = _moved(poses, numbers, slam.key_poses, nodes[count:])
    whole = [*places.keys, *(replace(key, scan=len(run) + key.scan) for key in slam.closer.keys)]
    second = refined(surfaces, second, whole, nodes, numbers)
    driven = _driven(places.poses)
    later = _driven(nodes[count:])
    driven = np.concatenate([driven, later + driven[-1] + 2.0 * LATER])
    ends = [(places.numbers[tie.old], numbers[tie.new - count]) for tie in ties]
    pairs = np.array(ends, np.int64).reshape(-1, 2)
    check = self_check(whole, nodes, driven, slam.closer.mixed_pixels.rate)
    best, *_ = sure
    return Joined(
        run, places.numbers, first, second, pairs, min(best.path), best.probability, whole, nodes,
        check,
    )  # fmt: skip


def _tied(
    places: KnownKeys, slam: Slam, poses: Float, sure: list[Found]
) -> tuple[Float, list[Closure]]:
    """Tie a drive to a map where it is found; returns the key poses (k, 3) of both, and the ties.

    In the first round, key scans whose places are certain are matched there, and the others where
    the drive then lies. In later rounds those without a tie are matched where the ties moved them.
    The best of the certain places comes first.
    """
    count = len(places.keys)
    own_edges = slam.edges.copy()
    own_edges["first"] += count
    own_edges["second"] += count
    graph = np.concatenate([_graph(places), own_edges])
    path = sure[0].path
    middle = sorted(path)[len(path) // 2]
    shift = compose(path[middle], between(poses[middle], np.zeros(3)))
    nodes = np.vstack([places.poses, compose(shift, slam.key_poses)])
    guesses = {number: pose for each in sure for number, pose in each.path.items()}
    ties: dict[int, Closure] = {}
    for _ in range(ROUNDS):
        for node, key in enumerate(slam.closer.keys, count):
            guess = guesses.get(key.scan, nodes[node])
            if node not in ties and (tie := _tie(places, key, guess, node)):
                ties[node] = tie
        if not ties:
            break
        guesses = {}
        nodes = optimised(nodes, np.concatenate([graph, closure_edges(list(ties.values()))]))
    return nodes, list(ties.values())


def _tie(places: KnownKeys, key: Key, guess: Float, number: int) -> Closure | None:
    """The tie of a key scan, by its number among all, to the map near a guess (3,)."""
    apart = np.hypot(*(places.poses[:, :2] - guess[:2]).T)
    if apart.min() >= COMPARED_WITHIN:
        return None
    found = places.judged(key, guess, np.diag(1.0 / GUESS_ERROR**2))
    if found is None or found.evidence < 0.0 or found.match.explained < CERTAIN_SHARE:
        return None
    pose = found.match.pose
    near = places.around(key, guess).tolist()
    olds = [places.keys[k] for k in near]
    if MixedPixelModel().contradict(olds, key, between(places.poses[near], pose)):
        return None
    old, *_ = near
    *_, heading = places.poses[old].tolist()
    information = MATCHING_SHARE * turned(fixed(found.match.information), -heading) + FLOOR
    return Closure(old, number, between(places.poses[old], pose), information)


def _graph(places: KnownKeys) -> Records:
    """The edges within a map: from each key scan to the next, and to an earlier one nearby."""
    poses = places.poses
    driven = _driven(places.poses)
    pairs = [(k, k + 1) for k in range(len(poses) - 1)]
    near_by = 1.0  # Distance between key scans [m] up to which they are joined like neighbours,
    near_by_turn = 0.5  # and turn [rad].
    for k in range(len(poses)):
        x, y, turn = between(poses[k], poses[:k]).T
        apart = np.hypot(x, y)
        beside = (apart < near_by) & (np.abs(turn) < near_by_turn)
        beside &= driven[:k] < driven[k] - LEAST_DISTANCE
        if beside.any():
            pairs.append((int(np.where(beside, apart, np.inf).argmin()), k))
    first, second = np.array(pairs, np.int64).reshape(-1, 2).T
    information = np.diag(1.0 / STEP**2)
    return edges_of(first, second, between(poses[first], poses[second]), information, information)


def _moved(poses: Float, numbers: Int, old: Float, new: Float) -> Float:
    """Move poses (n, 3) along with the key scans (m,) among them, from old poses to new ones."""
    return bent(poses, numbers, compose(new, between(old, poses[numbers])))


def _driven(poses: Float) -> Float:
    """The distance travelled up to each of the poses (k, 3) [m]."""
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])
