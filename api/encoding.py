"""JSON as the door writes it: floats exact to the last bit, NaN and infinity as null, UTF-8."""

import math
from collections.abc import Mapping

import orjson
from pydantic import BaseModel

__all__ = ["encode_json", "quantity"]


def encode_json(value: object) -> bytes:
    """Any mixture of mappings, sequences, dataclasses, models, numpy and plain values as JSON.

    Floats take the shortest decimal that reads back to the same bits; NaN and infinity become null.

    Raises:
        TypeError: a value that has no JSON form.
    """
    return orjson.dumps(value, default=_plain, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)


def quantity(value: float | None) -> float | None:
    """A finite float, or None for what is not known (None, NaN, infinity)."""
    return float(value) if value is not None and math.isfinite(value) else None


def _plain(value: object) -> object:
    if isinstance(value, BaseModel):
        return value.model_dump()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, tuple | set | frozenset):
        return list(value)
    raise TypeError(f"a {type(value).__name__} has no JSON form")
