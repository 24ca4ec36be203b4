"""LineMapper: merges the local map of each scan into the global map (section 3.1)."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any, NamedTuple, cast

from lrf3d.base.errors import InputError, shown
from lrf3d.geometry.lines import number, whole_number
from lrf3d.laser import LaserScan
from lrf3d.laser.noise import FLOOR, SIGMA
from lrf3d.laser.unrolling import motion_since, together, unrolled
from lrf3d.mapping.line_map import LineMap
from lrf3d.mapping.paper import PaperMapper, SplitMergeExtractor


class Thresholds(NamedTuple):
    """The settings of a mapper, with defaults filled in; see :class:`LineMapper`."""

    gap: float
    split: float
    merge_length: float
    merge_distance: float
    sigma: float
    floor: float
    min_points: int


class Mode(NamedTuple):
    """A mode of the mapper: how it is made, and the defaults that depend on the mode."""

    # Returns an object with the `update`, `local_map` and `map` of a LineMapper.
    make: Callable[[Thresholds], Any]
    merge_length: float
    # Deviations of sigma that are added to the default merge_distance.
    noise: float
    min_points: int


def _paper(limits: Thresholds) -> PaperMapper:
    extract = SplitMergeExtractor(limits.gap, limits.split)
    return PaperMapper(extract, limits.merge_length, limits.merge_distance, limits.min_points)


def _robust(limits: Thresholds) -> Any:
    # Compiled code takes a library that readers of settings need not wait for.
    from lrf3d.mapping.robust.extraction import LikelihoodExtractor
    from lrf3d.mapping.robust.mapper import RobustMapper

    extract = LikelihoodExtractor(limits.gap, limits.sigma, limits.floor)
    return RobustMapper(extract, limits.merge_length, limits.merge_distance, limits.min_points)


# The modes of the mapper; others may be entered, which world files and sweeps then have, too.
MODES = {"paper": Mode(_paper, 0.1, 0.5, 2), "robust": Mode(_robust, 0.5, 0.0, 4)}

# [m] Largest gap and split: larger ones would join all returns of a scan.
_MOST_GAP = 1e6

# [m] Largest standard deviation of a range.
_MOST_NOISE = 1e3

# [m] Largest values of the settings: larger ones would merge all walls of a place.
MOST = {
    "gap": _MOST_GAP, "split": _MOST_GAP, "merge_length": 100.0, "merge_distance": 10.0,
    "floor": _MOST_NOISE, "sigma": _MOST_NOISE,
}  # fmt: skip

# [m] Part of the default split and merge_distance that does not depend on the noise.
_TOLERANCE = 0.1


class LineMapper:
    """Builds a global map of line segments, grouped into objects, from scans at known poses.

    Args:
        mode: ``robust``, or ``paper`` for section 3 of the paper to the letter.
        gap: Two following points farther apart than this [m] are of two clusters.
        split: Paper mode: a polyline is split where a point is farther off than this [m];
            0.1 m and three deviations of the noise at half of range_max if not given.
        merge_length: T of Eq. 9 [m], 0.1 if not given; in robust mode the largest gap within
            a wall, 0.5.
        merge_distance: R of Eq. 9 [m]; 0.1 m and one deviation of the noise at half of
            range_max if not given. In robust mode how far two views of a wall may lie apart
            beside what noise explains, 0.1.
        sigma: Standard deviation of the range noise at range_max [m] (Eq. 7), 0.04 if not given.
            Robust mode learns the noise from the scans, and begins with this.
        floor: Robust mode: least standard deviation of a range at no distance [m].
        min_points: Segments of the map with fewer points than this are kept back until more
            points of them are seen; 2 in paper mode and 4 in robust mode if not given.

    Raises:
        InputError: There is no such mode, or a threshold is not a positive number.

    Examples:
        >>> import lrf3d
        >>> world = lrf3d.World([[3, -5, 3, 5], [3, 5, -3, 5]])
        >>> scan = lrf3d.EmbreeCaster(world).cast(lrf3d.LaserRangeFinder(), (0, 0, 0))
        >>> mapper = lrf3d.LineMapper()
        >>> mapper.update(scan)
        >>> len(mapper.map)
        2
        >>> mapper.map.segments.round(2).tolist()
        [[3.0, 5.0, -0.04, 5.0], [3.0, -5.03, 3.0, 5.0]]
    """

    def __init__(
        self,
        mode: Annotated[str, MODES] = "robust",
        *,
        gap: float = 2.5,
        split: float | None = None,
        merge_length: float | None = None,
        merge_distance: float | None = None,
        sigma: float | None = None,
        floor: float = FLOOR,
        min_points: int | None = None,
    ) -> None:
        if not isinstance(mode, str) or mode not in MODES:
            raise InputError(f"mapper mode {shown(mode)}: expected one of {', '.join(MODES)}")
        usual = MODES[mode]
        sigma = SIGMA if sigma is None else sigma
        number(sigma, "mapper: sigma", "metres", most=MOST["sigma"])
        split = _TOLERANCE + 1.5 * sigma if split is None else split
        self._settings = (
            f"{mode!r}, {gap=}, {split=}, {merge_length=}, {merge_distance=}, {sigma=}, {floor=},"
            f" {min_points=}"
        )
        length = usual.merge_length if merge_length is None else merge_length
        distance = _TOLERANCE + usual.noise * sigma if merge_distance is None else merge_distance
        limits = {
            "gap": gap, "split": split, "merge_length": length, "merge_distance": distance,
            "floor": floor,
        }  # fmt: skip
        # Compiled code is made for floats alone.
        known = {
            name: number(value, f"mapper: {name}", "metres", positive=True, most=MOST[name])
            for name, value in limits.items()
        }
        least = usual.min_points if min_points is None else min_points
        least = whole_number(least, "mapper: min_points", least=0)
        self.mode = mode
        self._limits = Thresholds(**known, sigma=float(sigma), min_points=least)
        self._last: LaserScan | None = None

    @cached_property
    def _mapper(self) -> Any:
        return MODES[self.mode].make(self._limits)

    def __repr__(self) -> str:
        return f"LineMapper({self._settings})"

    # It takes the scans of several lasers together, so that no wall ends where a fan does.
    several = True

    def update(self, scan: LaserScan | Sequence[LaserScan]) -> None:
        """Update the map with a scan, or with those of several lasers at one moment.

        A scan that took some time is unrolled by its motion; where that is unknown, the robot is
        assumed to move on as it has since the scan before.

        Raises:
            InputError: It is not a scan.
        """
        scans = tuple(scan) if isinstance(scan, list | tuple) else (scan,)
        if not scans or not all(isinstance(each, LaserScan) for each in scans):
            raise InputError(f"mapper: expected a LaserScan, found {shown(scan)}")
        whole = together(scans)
        before = self._last
        self._last = whole
        self._mapper.update(unrolled(whole, motion_since(before, whole)))

    def local_map(self, scan: LaserScan) -> LineMap:
        """The local map of one scan alone: each polyline is an object."""
        return cast(LineMap, self._mapper.local_map(scan))

    @property
    def map(self) -> LineMap:
        """The global map after all scans so far; the same object until the next update."""
        return cast(LineMap, self._mapper.map)
