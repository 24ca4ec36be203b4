"""Echoes of scans: the noise of the ranges on each of them, and echoes that come by themselves.

The true scan with its echoes enters, and what a noise made of its ranges; the measured scan with
its echoes leaves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lrf3d.laser.noise import Chain, Noise
from lrf3d.laser.scan import LaserScan


def measured(true_scan: LaserScan, noise: Noise, rng: np.random.Generator) -> LaserScan:
    """The measured scan: the noise of its ranges, and of its echoes where it has some.

    A chain acts part by part. The echo that is the range of a beam has the noise of that range;
    each other one has its own. Echoes that a noise loses are left out. A noise that changes echoes
    itself, as `MixedPixels`, is left alone.

    Args:
        true_scan: The scan without noise.
        noise: The noise.
        rng: Its generator.

    Examples:
        >>> import lrf3d
        >>> import numpy as np
        >>> from lrf3d.laser.echoes import measured
        >>> true = lrf3d.LaserScan((0, 0, 0), [0.0], [1.0], echoes=[[1.0, 3.0]], range_max=9.0,
        ...                        intensities=[0.4], echo_intensities=[[0.4, 0.1]])
        >>> scan = measured(true, lrf3d.ProportionalNoise(0.1), np.random.default_rng(0))
        >>> bool(scan.echoes[0, 0] == scan.ranges[0] != 1.0)
        True
    """
    if true_scan.echoes is None:
        return noise(true_scan, rng)
    scan = true_scan
    for part in noise.noises if isinstance(noise, Chain) else (noise,):
        changed = part(scan, rng)
        # What a user's noise returns is checked by who asked for the scan.
        if not isinstance(changed, LaserScan):
            return changed
        scan = _with_noise(scan, changed, part, rng)
    return scan


def _with_noise(
    true_scan: LaserScan, scan: LaserScan, noise: Noise, rng: np.random.Generator
) -> LaserScan:
    """What a noise made of a scan, with noise on its other echoes as well."""
    true_echoes, light = true_scan.echoes, true_scan.echo_intensities
    if true_echoes is None or light is None:
        return scan
    if scan.echoes is not None and not np.array_equal(scan.echoes, true_echoes):
        return scan
    echoes, lit = true_echoes.copy(), light.copy()
    for column in range(echoes.shape[1]):
        alone = replace(
            true_scan,
            ranges=true_echoes[:, column],
            intensities=light[:, column],
            echoes=None,
            echo_intensities=None,
        )
        echoes[:, column] = noise(alone, rng).ranges
    chosen = np.isfinite(true_echoes) & (true_echoes == true_scan.ranges[:, None])
    # Two echoes at one place have one range as well.
    echoes = np.where(chosen, scan.ranges[:, None], echoes)
    lost = ~np.isfinite(echoes)
    echoes[lost], lit[lost] = np.inf, 0.0
    order = np.argsort(echoes, axis=1, kind="stable")
    return replace(
        scan,
        echoes=np.take_along_axis(echoes, order, axis=1),
        echo_intensities=np.take_along_axis(lit, order, axis=1),
    )


def with_echoes(
    scans: Sequence[LaserScan], stamps: Sequence[int], echo_scans: Mapping[int, LaserScan]
) -> list[LaserScan]:
    """Scans with the echoes of those of the same stamps and beams.

    All of them have room for the same number of echoes: the most that any of them has.
    """
    lit = [
        replace(scan, echoes=other.echoes, echo_intensities=other.echo_intensities)
        if (other := echo_scans.get(stamp)) is not None and len(other.ranges) == len(scan.ranges)
        else scan
        for scan, stamp in zip(scans, stamps, strict=True)
    ]
    most = max((scan.echoes.shape[1] for scan in lit if scan.echoes is not None), default=0)
    return [_padded(scan, most) if scan.echoes is not None else scan for scan in lit]


def _padded(scan: LaserScan, slots: int) -> LaserScan:
    """A scan with room for a number of echoes of each beam."""
    echoes, light = scan.echoes, scan.echo_intensities
    if echoes is None or light is None or echoes.shape[1] == slots:
        return scan
    more = (0, 0), (0, slots - echoes.shape[1])
    return replace(
        scan,
        echoes=np.pad(echoes, more, constant_values=np.inf),
        echo_intensities=np.pad(light, more),
    )
