"""Values on the command line that are more than a number or a path."""

import argparse
import math

__all__ = [
    "ENDLESS_S",
    "condition",
    "forgetting",
    "job_count",
    "positive",
    "replay_speed",
    "row_count",
    "worker_count",
    "version_id",
    "wind",
]

ENDLESS_S = 1e9
"""Thirty years: no flight forgets anything of account."""

_FACTOR_HZ = 25.0
"""Samples a second that the thesis's factors (section 9.2) count in: its bins go up to 12 Hz (8.4)."""

_SHORTEST_S = 10.0
"""One block of the Fourier estimator, in which nothing is forgotten."""


def positive(text: str) -> float:
    """A number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a number above 0")
    return value


def job_count(text: str) -> int:
    """A whole number from 1."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 10_000):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a whole number from 1")
    return int(text)


def row_count(text: str) -> int:
    """A whole number from 1000."""
    if not (text.isascii() and text.isdigit() and 1000 <= int(text) <= 10**12):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a whole number from 1000")
    return int(text)


def worker_count(text: str) -> int:
    """A whole number from 1 to 64."""
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 64):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a whole number from 1 to 64")
    return int(text)


def replay_speed(text: str) -> float | None:
    """A speed, None for ``max``."""
    if text == "max":
        return None
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not (math.isfinite(rate) and rate > 0.0):
        raise argparse.ArgumentTypeError(f"{text!r} is no speed: give a number above 0, or max")
    return rate


def wind(text: str) -> tuple[float, float]:
    """Speed in m/s and the direction it comes from in rad."""
    speed, at, origin = text.partition("@")
    try:
        values = float(speed), math.radians(float(origin))
    except ValueError:
        values = math.nan, math.nan
    if not (at and all(map(math.isfinite, values)) and values[0] >= 0.0):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no wind: write SPEED@FROM_DEG, m/s from 0 and degrees, such as 5@270"
        )
    return values


def condition(text: str) -> tuple[float, float]:
    """True airspeed in m/s and altitude in m."""
    airspeed, _, altitude = text.partition(",")
    try:
        values = float(airspeed), float(altitude)
    except ValueError:
        values = math.nan, math.nan
    if not (all(map(math.isfinite, values)) and values[0] > 0.0):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no flight condition: write AIRSPEED,ALTITUDE in m/s and m, such as 27,1000"
        )
    return values


def version_id(text: str) -> int:
    """A whole number from 0."""
    if not (text.isascii() and text.isdigit() and int(text) < 2**63):
        raise argparse.ArgumentTypeError(f"{text!r} is not allowed: give a whole number from 0")
    return int(text)


def forgetting(text: str) -> float:
    """A time constant in s: ``40s``, ``none``, or a factor a sample as in thesis 9.2, ``0.998`` or ``0.999@50``.

    A weight that is multiplied by the factor f each sample falls to 1/e in -1 / (rate ln f): at 25 Hz, the thesis's,
    0.998 is 20 s, 0.9998 is 200 s, and 1 never forgets.
    """
    if text == "none":
        return ENDLESS_S
    seconds = _number(text.removesuffix("s")) if text.endswith("s") else _seconds_of_factor(text)
    if not math.isfinite(seconds):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no forgetting: give a time constant such as 40s, a factor a sample above 0 up to 1 such as "
            f"0.998 (at {_FACTOR_HZ:g} Hz) or 0.999@50 (at 50 Hz), or none"
        )
    if seconds < _SHORTEST_S:
        raise argparse.ArgumentTypeError(
            f"{text!r} forgets in {seconds:.3g} s, and the estimators read blocks of {_SHORTEST_S:g} s: give "
            f"{_SHORTEST_S:g}s or more"
        )
    return min(seconds, ENDLESS_S)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def _seconds_of_factor(text: str) -> float:
    factor_text, at, rate_text = text.partition("@")
    factor, rate_hz = _number(factor_text), _number(rate_text) if at else _FACTOR_HZ
    if not (0.0 < factor <= 1.0 and 0.0 < rate_hz < math.inf):
        return math.nan
    return ENDLESS_S if factor == 1.0 else -1.0 / (rate_hz * math.log(factor))
