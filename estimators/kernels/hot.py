"""How kernels on the path of every sample are compiled: they cannot allocate, and they count no references.

numba counts the references to every array that is passed on or sliced, by atomic increments; on arrays of a dozen
numbers that costs several times what is done with the numbers. Without its memory manager nothing is counted and
nothing can be allocated: a kernel that tries is refused by the compiler. All memory is handed in by the caller.

Loops over two or three states are as cheap as they look only where the compiler knows how many: sizes are
handed in once, as the lengths of tuples (``sizes``), and kernels are inlined into the function that receives them.
"""

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.registry import CPUDispatcher

from wingwatch.estimators.kernels.pieces import PieceCompiler

__all__ = ["entry", "helper", "hot", "lean", "part", "sizes", "whole", "whole_entry"]

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "forceinline": True,
    "_nrt": False,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
    "no_cfunc_wrapper": True,  # nobody takes a kernel's address, and for a state of 45 arrays it costs 0.2 s
}


_ALLOCATING: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}


class _Piece(CPUDispatcher):
    """A kernel that is compiled into those that call it. Where Python calls it, it is compiled by itself besides."""

    _by_itself: Any = None

    def __call__(self, *arguments: object) -> Any:
        if self._by_itself is None:
            self._by_itself = njit(**self._options)(self.py_func)
        return self._by_itself(*arguments)

    _options: dict[str, Any]


def _piece(options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a kernel that kernels call, with numba's options for it."""

    def decorate(function: Callable[..., Any]) -> Any:
        within = {name: value for name, value in options.items() if name != "cache"} | {
            "no_cpython_wrapper": True
        }
        piece = njit(**within, pipeline_class=PieceCompiler)(function)
        if isinstance(piece, CPUDispatcher):  # numba may be told to compile nothing
            piece.__class__, piece._options = _Piece, options | {"forceinline": False}
        return piece

    return decorate


hot: Any = _piece(_OPTIONS)
"""Decorator of such a kernel. A product may be fused into its sum, a sum taken in another order; NaN stays NaN."""

lean: Any = _piece(_OPTIONS | {"forceinline": False})
"""The same for a kernel that is called from several places: it stays one piece of code."""

helper: Any = _piece(_ALLOCATING)
"""Decorator of a kernel that kernels call and that may allocate."""

entry: Any = njit(**(_OPTIONS | {"forceinline": False, "nogil": True}))
"""Decorator of a kernel that Python calls and that takes milliseconds with many vehicles: other threads run meanwhile."""

whole: Any = njit(**_ALLOCATING)
"""Decorator of a kernel that Python calls and that may allocate.

As in all the others a division by zero gives what it gives in numpy: a kernel that takes many vehicles must not end at
one of them.
"""

whole_entry: Any = njit(**(_ALLOCATING | {"nogil": True}))
"""The same, and other threads run meanwhile. To get the interpreter's lock back takes longer than a short kernel."""

part: Any = njit(inline="always")
"""Decorator of a piece of one ``lean`` kernel, written apart to be read: it is compiled as text of that kernel alone.

A kernel that calls others is optimised and turned into code with all of them in it, at each layer of calls anew: a
layer above much code costs ten seconds of a first start.
"""


def sizes(*counts: int) -> tuple[tuple[int, ...], ...]:
    """Tuples of the given lengths: to numba a tuple's length is part of its type, so it compiles for these sizes."""
    return tuple((0,) * count for count in counts)
