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

__all__ = ["entry", "hot", "lean", "part", "sizes", "whole", "whole_entry"]

_OPTIONS: dict[str, Any] = {
    "cache": True,
    "forceinline": True,
    "_nrt": False,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc"},
    "no_cfunc_wrapper": True,  # nobody takes a kernel's address, and for a state of 45 arrays it costs 0.2 s
}


class _ForKernels(CPUDispatcher):
    """A kernel without the code that takes Python's arguments apart."""

    def __call__(self, *arguments: object) -> None:
        raise TypeError(f"{self.py_func.__qualname__} is private: kernels alone can call it")


def _kernel(**changed: Any) -> Callable[[Callable[..., Any]], Any]:
    """Decorator of a kernel; one whose name is private is compiled for other kernels only.

    To take a state of 45 arrays apart costs 0.4 s of compilation, and there are seventy such kernels.
    """
    options = _OPTIONS | changed

    def decorate(function: Callable[..., Any]) -> Any:
        if not function.__name__.startswith("_"):
            return njit(**options)(function)
        private = njit(**(options | {"no_cpython_wrapper": True}))(function)
        if isinstance(private, CPUDispatcher):  # numba may be set to compile nothing
            private.__class__ = _ForKernels  # called as others are, it would jump to the address 0
        return private

    return decorate


hot: Any = _kernel()
"""Decorator of such a kernel. A product may be fused into its sum, a sum taken in another order; NaN stays NaN."""

lean: Any = _kernel(forceinline=False)
"""The same for a kernel that is called from several places: it stays one piece of code.

Of these and of ``hot`` ones Python can call those whose name is public.
"""

entry: Any = _kernel(forceinline=False, nogil=True)
"""The same for one that Python calls and that takes milliseconds with many vehicles: other threads run meanwhile."""

_MAY_ALLOCATE: dict[str, Any] = {"cache": True, "error_model": "numpy", "no_cfunc_wrapper": True}
whole: Any = njit(**_MAY_ALLOCATE)
"""Decorator of a kernel that may allocate.

As in all the others a division by zero gives what it gives in numpy: a kernel that takes many vehicles must not end at
one of them.
"""

whole_entry: Any = njit(**(_MAY_ALLOCATE | {"nogil": True}))
"""The same, and other threads run meanwhile. To get the interpreter's lock back takes longer than a short kernel."""

part: Any = njit(inline="always")
"""Decorator of a piece of one ``lean`` kernel, written apart to be read: it is compiled as text of that kernel alone.

A kernel that calls others is optimised and turned into code with all of them in it, at each layer of calls anew: a
layer above much code costs ten seconds of a first start.
"""


def sizes(*counts: int) -> tuple[tuple[int, ...], ...]:
    """Tuples of the given lengths: to numba a tuple's length is part of its type, so it compiles for these sizes."""
    return tuple((0,) * count for count in counts)
