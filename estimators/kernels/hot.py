"""How kernels on the path of every sample are compiled: they cannot allocate, and they count no references.

numba counts the references to every array that is passed on or sliced, by atomic increments; on arrays of a dozen
numbers that costs several times what is done with the numbers. Without its memory manager nothing is counted and
nothing can be allocated: a kernel that tries is refused by the compiler. All memory is handed in by the caller.

Loops over two or three states are as cheap as they look only where the compiler knows how many: sizes are
handed in once, as the lengths of tuples (``sizes``), and kernels are inlined into the function that receives them.
"""

from typing import Any

from numba import njit

__all__ = ["hot", "lean", "part", "sizes"]

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "forceinline": True,
    "_nrt": False,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
}
hot: Any = njit(**_OPTIONS)
"""Decorator of such a kernel. A product may be fused into its sum, a sum taken in another order; NaN stays NaN."""

lean: Any = njit(**{**_OPTIONS, "forceinline": False})
"""The same for a kernel that is called from several places: it stays one piece of code."""

entry: Any = njit(**{**_OPTIONS, "forceinline": False, "nogil": True})
"""The same for one that Python calls and that takes milliseconds with many vehicles: other threads run meanwhile."""

whole: Any = njit(cache=True, error_model="numpy")
"""Decorator of a kernel that may allocate.

As in all the others a division by zero gives what it gives in numpy: a kernel that takes many vehicles must not end at
one of them.
"""

whole_entry: Any = njit(cache=True, nogil=True, error_model="numpy")
"""The same, and other threads run meanwhile. To get the interpreter's lock back takes longer than a short kernel."""

part: Any = njit(inline="always")
"""Decorator of a piece of one ``lean`` kernel, written apart to be read: it is compiled as text of that kernel alone.

A kernel that calls others is optimised and turned into code with all of them in it, at each layer of calls anew: a
layer above much code costs ten seconds of a first start.
"""


def sizes(*counts: int) -> tuple[tuple[int, ...], ...]:
    """Tuples of the given lengths: to numba a tuple's length is part of its type, so it compiles for these sizes."""
    return tuple((0,) * count for count in counts)
