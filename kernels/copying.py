"""Copies from one array onto another."""

from wingwatch.kernels.decorators import lean

__all__ = ["copy_into"]


@lean
def copy_into(source, target):  # type: ignore[no-untyped-def]
    """Copies contiguous arrays of one shape element by element.

    ``target[:] = source`` does the same, and numba adds to it code that words the error of two shapes that differ: five
    seconds of a first start.
    """
    for j in range(target.size):
        target.flat[j] = source.flat[j]
