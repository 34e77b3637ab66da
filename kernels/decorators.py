"""How kernels on the path of every sample are compiled: they cannot allocate, and they count no references.

numba counts the references to every array that is passed on or sliced, by atomic increments; on arrays of a dozen
numbers that costs several times what is done with the numbers. Without its memory manager nothing is counted and
nothing can be allocated: a kernel that tries is refused by the compiler. All memory is handed in by the caller.

Loops over two or three states are as cheap as they look only where the compiler knows how many: sizes are
handed in once, as the lengths of tuples (``sizes``), and kernels are inlined into the function that receives them.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any, cast

from numba import njit
from numba.core.registry import CPUDispatcher

from wingwatch.kernels.keeping import KernelCache
from wingwatch.kernels.pieces import PieceCompiler

__all__ = ["compiled", "entry", "helper", "hot", "lean", "part", "sizes", "whole", "whole_entry"]

_OPTIONS: dict[str, Any] = {
    "forceinline": True,
    "_nrt": False,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
    "no_cfunc_wrapper": True,  # nobody takes a kernel's address
}

_ALLOCATING: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True}


class _Piece(CPUDispatcher):
    """A kernel that is compiled into those that call it. Where Python calls it, it is compiled by itself besides."""

    _alone: Any = None
    _options: dict[str, Any]

    @property
    def by_itself(self) -> Any:
        """The kernel that Python calls."""
        if self._alone is None:
            self._alone = compiled(**self._options)(self.py_func)
        return self._alone

    def __call__(self, *arguments: object) -> Any:
        return self.by_itself(*arguments)


def compiled(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a kernel with numba's own options; what is compiled is kept (``keeping``)."""

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = njit(**(options | {"cache": True}))(function)
        if isinstance(dispatcher, CPUDispatcher):  # numba may be set to compile nothing
            vars(dispatcher)["_cache"] = KernelCache(cast(FunctionType, function))
        return dispatcher

    return decorate


def _piece(options: dict[str, Any]) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a kernel that kernels call, with numba's options for it."""

    def decorate(function: Callable[..., Any]) -> Any:
        within = options | {"cache": False, "no_cpython_wrapper": True}
        piece = njit(**within, pipeline_class=PieceCompiler)(function)
        if isinstance(piece, CPUDispatcher):  # numba may be set to compile nothing
            piece.__class__ = _Piece
            vars(piece)["_options"] = options | {"forceinline": False}
        return piece

    return decorate


hot: Any = compiled(**_OPTIONS)
"""Decorator of such a kernel that every sample goes through. A product may be fused into its sum, a sum be taken in
another order; NaN stays NaN.

It is no piece: optimised by itself and once more in its caller, the filter's step is a third cheaper.
"""

lean: Any = _piece(_OPTIONS | {"forceinline": False})
"""The same for a kernel of solutions, or that is called from several places: a piece, and one piece of code."""

helper: Any = _piece(_ALLOCATING)
"""Decorator of a kernel that kernels call and that may allocate."""

entry: Any = compiled(**(_OPTIONS | {"forceinline": False, "nogil": True}))
"""Decorator of a kernel that Python calls, for milliseconds with many vehicles: other threads run meanwhile."""

whole: Any = compiled(**_ALLOCATING)
"""Decorator of a kernel that Python calls and that may allocate.

As in all the others a division by zero gives what it gives in numpy: a kernel that takes many vehicles must not end at
one of them.
"""

whole_entry: Any = compiled(**(_ALLOCATING | {"nogil": True}))
"""The same, and other threads run meanwhile. To get the interpreter's lock back takes longer than a short kernel."""

part: Any = njit(inline="always")
"""Decorator of a piece of one kernel, written apart to be read: it is compiled as text of that kernel alone."""


def sizes(*counts: int) -> tuple[tuple[int, ...], ...]:
    """Tuples of the given lengths: to numba a tuple's length is part of its type, so it compiles for these sizes."""
    return tuple((0,) * count for count in counts)
