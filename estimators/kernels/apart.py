"""Arrays far enough from each other in memory that compiled code does the same with them wherever they lie.

A loop that reads one array and writes another is compiled twice, for several elements at a time and for one; which is
taken is decided when it runs, by whether the one begins less than a vector's stride after the other. The two differ by
rounding. Small arrays that the allocator puts side by side would make numbers depend on what else the process holds.
"""

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["apart", "room_around"]

_ROOM = 256
"""Bytes free on either side: twice of what four vectors of four numbers take."""

_LARGE = 1 << 16

Named = TypeVar("Named", bound=tuple[Any, ...])


def room_around(array: NDArray[Any]) -> NDArray[Any]:
    """A contiguous copy with room on either side of it; an array that has a page of its own and more as it is."""
    if array.nbytes >= _LARGE and array.flags.owndata:
        return array
    room = np.zeros(array.nbytes + 2 * _ROOM, dtype=np.uint8)
    copy = room[_ROOM : _ROOM + array.nbytes].view(array.dtype).reshape(array.shape)
    copy[...] = array
    return copy


def apart(arrays: Named) -> Named:
    """The same named arrays, each a copy with room around it; what was one array stays one."""
    return _apart(arrays, {})


def _apart(arrays: Named, copies: dict[int, NDArray[Any]]) -> Named:
    kind: Any = type(arrays)
    moved: list[Any] = []
    for a in arrays:
        if isinstance(a, tuple):
            moved.append(_apart(a, copies))
        else:
            moved.append(copies.setdefault(id(a), room_around(a)))
    return kind(*moved)  # type: ignore[no-any-return]
