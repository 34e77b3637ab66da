"""Noise variances of a Fourier block between its solutions: where they begin, and within what they are kept; compiled.

Derivation and equation numbers: ``docs/methods/fourier.md`` section 4. Arrays are those of one vehicle.
"""

import math

from wingwatch.estimators.fourier.noise import SMALLEST_VARIANCE, between_samples_variance
from wingwatch.estimators.fourier.state import AIR_VARIANCES, BETWEEN, GUST, ROLLING, WEIGHT
from wingwatch.kernels.decorators import lean

__all__ = ["AIR_MEMORY", "INPUT_RESOLUTION", "start_noise", "update_noise"]

LOWEST_NOISE = 0.5
"""A noise variance is not believed to be less than this fraction of the roughness (which signal, too, enlarges)."""

ROOT_MEAN = 0.8221790
"""Mean of the square root of a standard normal number's magnitude, 2^(1/4) Gamma(3/4) / sqrt(pi)."""

INPUT_RESOLUTION = 1e-12
"""Least noise variance of a surface, (1e-6 rad)^2: a surface at rest leaves rounding in its transform, no signal."""

AIR_MEMORY = 0.2
"""Weight of the air of earlier blocks beside a whole block's own, in blocks: two seconds."""

ROUGH_CHANCE = 2.4
"""Relative standard deviation of ``_rough_noise`` times the root of the count: that of the fourth power of the mean of
roots, 4 sqrt(0.180), differences of white noise being correlated by sqrt(35 / 18)."""


@lean
def _rough_noise(roughness, j, ns):  # type: ignore[no-untyped-def]
    """Variance of white noise of channel ``j`` that second differences (variance 6 D) would have such roots from.

    The roots of their magnitudes are summed, not their squares: a jump of a surface makes large ones, but rarely.
    """
    root = roughness[j] / max(roughness[ns + 1], 1.0) / ROOT_MEAN
    return root**4 / 6.0


@lean
def start_noise(model, roughness, noise):  # type: ignore[no-untyped-def]
    """First variances from second differences, whose variance is 6 D for white noise; those of the air as of a breeze
    that moves 1 m/s2 from sample to sample, which the first solutions correct; none where the air is not known to
    turn."""
    ns = model.lever.size
    for j in range(ns + 1):
        least = 1e-8 if j in (0, ns) else 1e-10
        noise[j] = max(_rough_noise(roughness, j, ns), least)
    for k in range(ns):
        noise[ns + 1 + k] = noise[k]
    noise[GUST], noise[ROLLING], noise[BETWEEN] = 1.0, 1e-4, 0.0
    if model.turn_smoothing_m == 0.0:
        noise[GUST] = 0.0


@lean
def update_noise(at, fresh, fraction, dt, roughness, plant, air):  # type: ignore[no-untyped-def]
    """Noise variances from this block's residual and from earlier blocks, by the time each rests on.

    Sensors' noise is the same in all blocks, and white, so between half and all of the roughness (two standard
    deviations of chance allowed): what is more, is air or what a moment equation leaves out. Of the roughness of vane
    and accelerometer the gust has its part: a walk of variance D dt^2 a step leaves 2 D dt^2 in second differences,
    white noise of variance R leaves 6 R, and the accelerometer feels the walk by the force's derivative. Below any
    sensor's resolution nothing is gained: 1e-4 m/s and m/s2, 1e-5 rad/s. Air changes: of earlier blocks little is
    believed.
    """
    noise, noise_known = at.noise, at.noise_known
    first, ns, slope = noise.size - AIR_VARIANCES, plant.lever.size, plant.derivatives[0, 0]
    gust_walk = noise[GUST] * dt * dt / 3.0
    for j in range(noise.size):
        if 2 * ns + 1 <= j < first:
            continue
        sensor = j <= ns
        known = noise_known[WEIGHT] if j < first else min(noise_known[WEIGHT], AIR_MEMORY)
        noise[j] = (known * noise_known[j] + fraction * fresh[j]) / (known + fraction)
        if sensor:
            rough = _rough_noise(roughness, j, ns)
            most = rough * (1.0 + 2.0 * ROUGH_CHANCE / math.sqrt(max(roughness[ns + 1], 1.0)))
            if not plant.kinematic:
                most = math.inf  # a reconstructed velocity's noise is no white noise
            least = 1e-8 if j in (0, ns) else 1e-10
            walk = gust_walk * (1.0 if j == 0 else (slope * slope if j == ns else 0.0))
            noise[j] = max(min(noise[j], most), LOWEST_NOISE * (rough - walk), least)
            fresh[j] = min(fresh[j], max(most, least))
        else:
            noise[j] = max(noise[j], SMALLEST_VARIANCE)
    noise[ns + 1 if plant.by_accelerometer else ns] = 0.0
    if air.turn != 0.0:
        noise[ns + 1] = 0.0  # all that a force equation leaves out is the gust's rate
    noise[BETWEEN] = between_samples_variance(noise[GUST], dt)
    if ns == 3:
        noise[ns + 2] = 0.0
