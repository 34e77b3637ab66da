"""How alerts, their causes and what a flight could have shown are written, on a terminal and on a page."""

import math

from wingwatch.api import CandidateDocument, CouldSeeDocument
from wingwatch.pages.texts import number, probability_text

__all__ = ["candidate_text", "plus_minus", "smallest_size_text", "spaced"]

_SIZELESS = ("surface_stuck", "sensor_freeze")  # there or not


def candidate_text(one: CandidateDocument) -> str:
    """A cause that is possible for an alert, with its probability."""
    where = "" if one.channel is None else f" of {one.channel}"
    probability = math.nan if one.probability is None else one.probability
    return f"{spaced(one.cause)}{where}, probability {probability_text(probability)}"


def smallest_size_text(one: CouldSeeDocument) -> str:
    """The smallest change that would have been noticed."""
    if one.smallest_size is None:
        return "not seen"
    return "seen" if one.cause in _SIZELESS else f"{number(one.smallest_size)} {one.unit}".rstrip()


def plus_minus(value: float | None, error: float | None) -> str:
    """Value ± standard error, a dash where one of them is not known."""
    return "-" if value is None or error is None else f"{value:.4g} ± {error:.2g}"


def spaced(name: str) -> str:
    """A name of the vocabulary as words."""
    return name.replace("_", " ")
