"""Random numbers for compiled kernels: a stream of its own for each vehicle, as four words of one array.

xoshiro256++ (Blackman and Vigna, Scrambled linear pseudorandom number generators, ACM TOMS 47, 2021) gives 64 bits;
the ziggurat of 256 levels (Marsaglia and Tsang, The ziggurat method for generating random variables, J. Stat. Softw.
5, 2000) makes them normal. Level, sign and place come from bits that are not shared (Doornik 2005 on why they must not
be). A quarter of the time of numpy's generator, which cannot be handed to a kernel in a batch.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wingwatch.kernels.decorators import helper

__all__ = ["fill_normals", "random_streams", "uniform"]

_LEVELS = 256
_TAIL = 3.6541528853610088
"""Where the lowest level's tail starts, for 256 levels of equal area (Marsaglia and Tsang)."""
_U = np.uint64
_MANTISSA_BITS = 52
_MANTISSA = np.uint64(2**_MANTISSA_BITS - 1)
_LEVEL = np.uint64(_LEVELS - 1)


def _edges() -> NDArray[np.float64]:
    """Right edges of the levels, lowest first, shape (257,); the lowest one's is that of a box with its tail's area."""
    height = math.exp(-0.5 * _TAIL * _TAIL)
    area = _TAIL * height + math.sqrt(0.5 * math.pi) * math.erfc(_TAIL / math.sqrt(2.0))
    edges = np.zeros(_LEVELS + 1)
    edges[0], edges[1] = area / height, _TAIL
    for i in range(2, _LEVELS):
        edges[i] = math.sqrt(-2.0 * math.log(area / edges[i - 1] + math.exp(-0.5 * edges[i - 1] ** 2)))
    return edges


_EDGES = _edges()
_HEIGHTS = np.exp(-0.5 * _EDGES**2)
_STEP = _EDGES[:_LEVELS] * 2.0**-_MANTISSA_BITS
_INSIDE = np.array(
    [int(math.ldexp(_EDGES[i + 1] / _EDGES[i], _MANTISSA_BITS)) for i in range(_LEVELS)], dtype=np.uint64
)
"""Below it a place on a level is under the curve whatever its height."""


def random_streams(generators: Sequence[np.random.Generator]) -> NDArray[np.uint64]:
    """A stream from each generator, shape (generators, 4); four words of each generator are consumed."""
    words = [g.integers(0, 2**64, 4, dtype=np.uint64) for g in generators]
    return np.array(words, dtype=np.uint64).reshape(-1, 4)


@helper
def _rotated(word, bits):  # type: ignore[no-untyped-def]
    return (word << _U(bits)) | (word >> _U(64 - bits))


@helper
def _bits(stream):  # type: ignore[no-untyped-def]
    """The next 64 bits of a stream (4,)."""
    out = _rotated(stream[0] + stream[3], 23) + stream[0]
    carry = stream[1] << _U(17)
    stream[2] ^= stream[0]
    stream[3] ^= stream[1]
    stream[1] ^= stream[2]
    stream[0] ^= stream[3]
    stream[2] ^= carry
    stream[3] = _rotated(stream[3], 45)
    return out


@helper
def uniform(stream):  # type: ignore[no-untyped-def]
    """The next number of a stream (4,), uniform on [0, 1)."""
    return np.float64(np.int64(_bits(stream) >> _U(11))) * 2.0**-53


@helper
def _half_normal(stream, level, x):  # type: ignore[no-untyped-def]
    """A magnitude, where the first place drawn, ``x`` on ``level``, lies beyond the next level's edge."""
    while True:
        if level == 0:
            while True:
                beyond = -math.log1p(-uniform(stream)) / _TAIL
                drawn = -math.log1p(-uniform(stream))
                if drawn + drawn > beyond * beyond:
                    return _TAIL + beyond
        height = _HEIGHTS[level] + (_HEIGHTS[level + 1] - _HEIGHTS[level]) * uniform(stream)
        if height < math.exp(-0.5 * x * x):
            return x
        bits = _bits(stream)
        level, place = np.int64(bits & _LEVEL), (bits >> _U(9)) & _MANTISSA
        x = np.float64(np.int64(place)) * _STEP[level]
        if place < _INSIDE[level]:
            return x


@helper
def fill_normals(stream, out):  # type: ignore[no-untyped-def]
    """The next standard normal numbers of a stream (4,) into ``out``, one dimension."""
    s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
    for i in range(out.size):
        bits = _rotated(s0 + s3, 23) + s0
        carry = s1 << _U(17)
        s2 ^= s0
        s3 ^= s1
        s1 ^= s2
        s0 ^= s3
        s2 ^= carry
        s3 = _rotated(s3, 45)
        level, place = np.int64(bits & _LEVEL), (bits >> _U(9)) & _MANTISSA
        x = np.float64(np.int64(place)) * _STEP[level]
        if place >= _INSIDE[level]:
            stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
            x = _half_normal(stream, level, x)
            s0, s1, s2, s3 = stream[0], stream[1], stream[2], stream[3]
        out[i] = x if (bits >> _U(8)) & _U(1) != _U(0) else -x
    stream[0], stream[1], stream[2], stream[3] = s0, s1, s2, s3
