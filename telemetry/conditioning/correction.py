"""Sensor errors taken out of a table: the inverse of what ``path_model`` says a sensor reads."""

from collections.abc import Sequence

import numpy as np

from wingwatch.telemetry.conditioning.parameter import Parameter
from wingwatch.telemetry.sample import CHANNEL_INDEX, SampleBlock

__all__ = ["without_errors"]

_KINDS = ("bias of ", "scale of ")


def without_errors(block: SampleBlock, parameters: Sequence[Parameter]) -> SampleBlock:
    """A table whose channels read (value - bias) / (1 + scale), for the errors that were found.

    Args:
        block: samples.
        parameters: of ``reconstruct_path``; what is not observable, and what is no sensor's error, is left alone.

    Raises:
        ValueError: a name that is no flight-table channel, or a scale that turns the sign.
    """
    found: dict[str, dict[str, float]] = {}
    for p in parameters:
        for kind in _KINDS:
            if p.observable and p.name.startswith(kind):
                found.setdefault(p.name.removeprefix(kind), {})[kind] = p.value
    values = block.values.copy()
    for name, errors in found.items():
        bias, scale = errors.get(_KINDS[0], 0.0), errors.get(_KINDS[1], 0.0)
        if name not in CHANNEL_INDEX:
            raise ValueError(f"{name!r} is no flight-table channel and cannot be corrected")
        if not (np.isfinite(bias) and scale > -1.0):
            raise ValueError(f"{name} with a bias of {bias} and a scale error of {scale} cannot be corrected")
        values[:, CHANNEL_INDEX[name]] = (block.column(name) - bias) / (1.0 + scale)
    return SampleBlock(values)
