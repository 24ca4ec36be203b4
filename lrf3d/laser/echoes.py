"""Echoes of scans: the noise of the ranges on each of them.

The true scan with its echoes enters, and the measured scan with its echoes leaves.
"""

from dataclasses import replace

import numpy as np

from lrf3d.geometry import Float
from lrf3d.laser.noise import Chain, Noise
from lrf3d.laser.scan import LaserScan


def measured(true_scan: LaserScan, noise: Noise, rng: np.random.Generator) -> LaserScan:
    """The measured scan: the noise of its ranges, and of its echoes where it has some.

    A chain acts part by part. The echo that is the range of a beam has the noise of that range;
    each other one has its own. Echoes that a noise loses are left out. A noise that changes echoes
    itself, as `MixedPixels`, is left alone.

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
    scan = true_scan
    for part in noise.noises if isinstance(noise, Chain) else (noise,):
        changed = part(scan, rng)
        # What a user's noise returns is checked by who asked for the scan.
        if not isinstance(changed, LaserScan):
            return changed
        if scan.echoes is not None and scan.echo_intensities is not None:
            changed = _with_echoes(scan, scan.echoes, scan.echo_intensities, changed, part, rng)
        scan = changed
    return scan


def _with_echoes(
    true_scan: LaserScan, true_echoes: Float, light: Float, scan: LaserScan, noise: Noise,
    rng: np.random.Generator,
) -> LaserScan:  # fmt: skip
    """What a noise made of a scan with echoes and their light (beams, k), with noise on these."""
    if scan.echoes is not None and not np.array_equal(scan.echoes, true_echoes):
        return scan
    echoes, lit = true_echoes.copy(), light.copy()
    bare = replace(true_scan, echoes=None, echo_intensities=None)
    for column in range(echoes.shape[1]):
        alone = replace(bare, ranges=true_echoes[:, column], intensities=light[:, column])
        echoes[:, column] = noise(alone, rng).ranges
    chosen = np.isfinite(true_echoes) & (true_echoes == true_scan.ranges[:, None])
    # Two echoes at one place have one range as well.
    echoes = np.where(chosen, scan.ranges[:, None], echoes)
    lost = ~np.isfinite(echoes)
    echoes[lost], lit[lost] = np.inf, 0.0
    order = np.argsort(echoes, axis=1, kind="stable")
    echoes, lit = (np.take_along_axis(values, order, axis=1) for values in (echoes, lit))
    return replace(scan, echoes=echoes, echo_intensities=lit)
