"""Static derivatives from trimmed segments: what estimators that remove the trim must leave out (thesis 10.4).

At rest, wings level and with thrust along a line through the centre of gravity, the pitching moment is zero,

    Cm_0 + Cm_alpha alpha + Cm_eta eta = 0:   eta = -Cm_0 / Cm_eta - (Cm_alpha / Cm_eta) alpha,

so elevator against angle of attack over segments of different airspeed gives two ratios, and never the three
derivatives. Concise: m_w / m_eta = (Cm_alpha / Cm_eta) / V. Normal force against angle of attack gives the slope
with the elevator that keeps trim, C_N_alpha + C_N_eta d eta / d alpha; apart the two do not come. With the elevator's
power (Cm_eta) the static margin follows, -Cm_alpha over the slope of the trimmed normal force: Cm_eta d eta / d C_N. So
many mean chords behind the centre of gravity lies the neutral point.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wingwatch.telemetry.conditioning import Parameter, SteadySegment

__all__ = ["StaticDerivatives", "static_derivatives", "static_margin", "straight_line"]

Array = NDArray[np.float64]

_RANGE = 3.0
"""Segments must differ in angle of attack by so many standard errors of a difference: else there is no slope."""


@dataclass(frozen=True, slots=True)
class StaticDerivatives:
    """What trimmed flight says.

    Attributes:
        elevator_slope: d eta / d alpha = -Cm_alpha / Cm_eta.
        elevator_at_zero: eta at alpha = 0 = -Cm_0 / Cm_eta, rad.
        moment_ratio: m_w / m_eta at ``airspeed_m_s``, in s/m (1/(m s) over 1/s2).
        normal_force_slope: d C_N / d alpha with the elevator that trims, per rad.
        normal_force_at_zero: C_N at alpha = 0.
        elevator_against_normal_force: d eta / d C_N, rad.
        airspeed_m_s: mean of the segments.
        segments: how many there were.
        misfit: of the two lines, root mean square of what is left over what was expected; where it is over 1 the
            errors have been multiplied by it.
    """

    elevator_slope: Parameter
    elevator_at_zero: Parameter
    moment_ratio: Parameter
    normal_force_slope: Parameter
    normal_force_at_zero: Parameter
    elevator_against_normal_force: Parameter
    airspeed_m_s: float
    segments: int
    misfit: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Line:
    """y = intercept + slope x, with the covariance of (intercept, slope), and chi-square over its expectation."""

    intercept: float
    slope: float
    covariance: Array
    misfit: float


def static_derivatives(
    segments: Sequence[SteadySegment], mass_kg: float, wing_area_m2: float
) -> StaticDerivatives:
    """Ratios of static derivatives from steady segments (``telemetry.conditioning.steady_segments``).

    Args:
        segments: at the centre of gravity; elevator, angle of attack, a_z, airspeed and density are used.
        mass_kg: of the aircraft then.
        wing_area_m2: that coefficients refer to.

    Returns:
        Parameters that are not observable, with the reason, where fewer than three segments differ enough.

    Raises:
        ValueError: a mass or an area that is not positive, or a segment that lacks a channel.
    """
    for name, value in (("mass_kg", mass_kg), ("wing_area_m2", wing_area_m2)):
        if not (math.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} is {value}; give a positive number")
    names = (
        "angle_of_attack_rad",
        "elevator_rad",
        "specific_force_z_m_s2",
        "airspeed_true_m_s",
        "air_density_kg_m3",
    )
    for segment in segments:
        if absent := [n for n in names if n not in segment.mean]:
            raise ValueError(
                f"the segment at {segment.start_s:g} s has no {absent[0]}: static derivatives need it"
            )
    mean = np.array([[s.mean[n] for n in names] for s in segments]).reshape(-1, 5)
    error = np.array([[s.standard_error[n] for n in names] for s in segments]).reshape(-1, 5)
    reason = _too_little(mean[:, 0], error[:, 0])
    speed = float(np.mean(mean[:, 3])) if len(segments) else math.nan
    if reason:
        return _nothing(reason, speed, len(segments))
    force = -mass_kg * mean[:, 2] / (0.5 * mean[:, 4] * mean[:, 3] ** 2 * wing_area_m2)
    force_error = np.abs(force) * np.hypot(error[:, 2] / mean[:, 2], 2.0 * error[:, 3] / mean[:, 3])
    trim = straight_line(mean[:, 0], mean[:, 1], error[:, 0], error[:, 1])
    lift = straight_line(mean[:, 0], force, error[:, 0], force_error)
    direct = straight_line(force, mean[:, 1], force_error, error[:, 1])
    slope_error = math.sqrt(trim.covariance[1, 1])
    return StaticDerivatives(
        Parameter("d eta / d alpha", trim.slope, slope_error, ""),
        Parameter("eta at alpha 0", trim.intercept, math.sqrt(trim.covariance[0, 0]), "rad"),
        Parameter("m_w / m_eta", -trim.slope / speed, slope_error / speed, "s/m"),
        Parameter("d C_N / d alpha", lift.slope, math.sqrt(lift.covariance[1, 1]), "1/rad"),
        Parameter("C_N at alpha 0", lift.intercept, math.sqrt(lift.covariance[0, 0]), ""),
        Parameter("d eta / d C_N", direct.slope, math.sqrt(direct.covariance[1, 1]), "rad"),
        speed,
        len(segments),
        (trim.misfit, lift.misfit),
    )


def _too_little(alpha: Array, error: Array) -> str:
    if alpha.size < 3:
        return f"{alpha.size} steady segments are no line: at least 3 are needed"
    reach, doubt = float(np.ptp(alpha)), math.sqrt(2.0) * float(np.max(error))
    if reach < _RANGE * doubt:
        return f"the segments' angles of attack differ by {reach:.2g} rad, less than {_RANGE:g} errors of {doubt:.2g}"
    return ""


def _nothing(reason: str, speed: float, count: int) -> StaticDerivatives:
    def no(name: str, unit: str) -> Parameter:
        return Parameter(name, math.nan, math.inf, unit, False, reason)

    return StaticDerivatives(
        no("d eta / d alpha", ""), no("eta at alpha 0", "rad"), no("m_w / m_eta", "s/m"),
        no("d C_N / d alpha", "1/rad"), no("C_N at alpha 0", ""), no("d eta / d C_N", "rad"),
        speed, count, (math.nan, math.nan),
    )  # fmt: skip


def straight_line(x: Array, y: Array, x_error: Array, y_error: Array) -> Line:
    """The line through points (n,) that err in both coordinates, n at least 3 (York et al., Am. J. Physics 72, 2004).

    Errors are multiplied by the misfit where that is over 1: points that lie off by more than they should.
    """
    slope = float(np.polyfit(x, y, 1)[0])
    tiny = 1e-12 * max(float(np.ptp(x)), float(np.ptp(y)), 1e-12)
    for _ in range(50):
        weight = 1.0 / (np.maximum(y_error, tiny) ** 2 + (slope * np.maximum(x_error, tiny)) ** 2)
        x_mean, y_mean = np.average(x, weights=weight), np.average(y, weights=weight)
        u, v = x - x_mean, y - y_mean
        beta = weight * (u * np.maximum(y_error, tiny) ** 2 + slope * v * np.maximum(x_error, tiny) ** 2)
        before, slope = slope, float(np.sum(weight * beta * v) / np.sum(weight * beta * u))
        if abs(slope - before) <= 1e-12 * abs(slope):
            break
    intercept = float(y_mean - slope * x_mean)
    adjusted = x_mean + beta
    middle = float(np.average(adjusted, weights=weight))
    variance = 1.0 / float(np.sum(weight * (adjusted - middle) ** 2))
    chi = float(np.sum(weight * (y - intercept - slope * x) ** 2)) / (x.size - 2)
    base = np.array(
        [
            [1.0 / float(np.sum(weight)) + middle**2 * variance, -middle * variance],
            [-middle * variance, variance],
        ]
    )
    return Line(intercept, slope, base * max(chi, 1.0), math.sqrt(chi))


def static_margin(found: StaticDerivatives, cm_eta_per_rad: float, cm_eta_error_per_rad: float) -> Parameter:
    """Static margin in mean chords, -Cm_alpha / C_N_alpha, from the trim lines and the elevator's power.

    Args:
        found: of ``static_derivatives``.
        cm_eta_per_rad: as the aircraft file has it, or from a dynamic estimate: Cm_eta = m_eta I_y / (q S c).
        cm_eta_error_per_rad: its standard error.

    Returns:
        Positive for a stable aircraft; not observable where the slopes are not.
    """
    slope = found.elevator_against_normal_force
    if not slope.observable:
        return Parameter("static margin", math.nan, math.inf, "chords", False, slope.reason)
    value = cm_eta_per_rad * slope.value
    error = math.hypot(cm_eta_error_per_rad * slope.value, cm_eta_per_rad * slope.standard_error)
    return Parameter("static margin", value, error, "chords")
