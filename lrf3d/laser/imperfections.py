"""Imperfections: what is known of a range finder, as the chain of noises that it amounts to."""

from dataclasses import dataclass

import numpy as np

from lrf3d.laser.angle_noise import AngleNoise
from lrf3d.laser.drop_outs import DropOuts
from lrf3d.laser.mixed_pixels import MixedPixels
from lrf3d.laser.noise import (
    Chain,
    ConstantNoise,
    Limits,
    Noise,
    ProportionalNoise,
    Quantised,
)


@dataclass(frozen=True, slots=True)
class Imperfections:
    """What a range finder does beside the noise of Eq. 7; all of it off by default.

    Args:
        constant: Noise of every range [m]; see ConstantNoise.
        angle_deg: Noise of every angle [°]; see AngleNoise.
        beam_deg: How wide a beam is [°]; see MixedPixels.
        drop_outs: Share of beams that are lost anywhere; see DropOuts.
        drop_outs_far: Probability of being lost at range_max.
        drop_outs_grazing: Probability of being lost along a wall.
        resolution: Steps in which ranges are told [m]; see Quantised.
    """

    constant: float = 0.0
    angle_deg: float = 0.0
    beam_deg: float = 0.0
    drop_outs: float = 0.0
    drop_outs_far: float = 0.0
    drop_outs_grazing: float = 0.0
    resolution: float = 0.0

    def noise(self, sigma: float) -> Noise:
        """All of it, with noise of σ [m] at range_max, in the order in which it comes about.

        What is off is not in the chain; where all is off, the noise of Eq. 7 is left alone.
        """
        lost = self.drop_outs, self.drop_outs_far, self.drop_outs_grazing
        chain: list[Noise] = []
        if self.angle_deg:
            chain.append(AngleNoise(float(np.radians(self.angle_deg))))
        if self.beam_deg:
            chain.append(MixedPixels(float(np.radians(self.beam_deg))))
        if any(lost):
            chain.append(DropOuts(*lost))
        if self.constant:
            chain.append(ConstantNoise(self.constant))
        chain.append(ProportionalNoise(sigma))
        if self.resolution:
            chain.append(Quantised(self.resolution))
        return chain[0] if len(chain) == 1 else Chain([*chain, Limits()])
