"""Values on the command line that are more than a number or a path."""

import argparse
import math

__all__ = ["condition", "job_count", "positive", "replay_speed", "row_count", "version_id", "wind"]


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
