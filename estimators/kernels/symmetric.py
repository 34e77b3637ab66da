"""Linear algebra of small symmetric matrices, in place and without allocation; compiled.

A library's routines spend more time on being called than on a dozen rows. Here the innermost loops run along rows,
which the processor takes several numbers at a time of. Only lower triangles of the Cholesky roots are read or written.
"""

import math

from wingwatch.kernels.decorators import lean

__all__ = [
    "all_above",
    "all_below",
    "cholesky",
    "congruence",
    "eigen",
    "forward",
    "backward",
    "invert",
    "product",
    "solve_general",
    "whiten",
]

MOST_SWEEPS = 60
"""Steps after which an eigenvalue is taken as it is; three are usual."""


@lean
def cholesky(matrix, least, root):  # type: ignore[no-untyped-def]
    """Lower Cholesky root (n, n) of a symmetric positive definite matrix; no pivot is believed below ``least``.

    Returns:
        whether all pivots were above ``least``. ``root`` may be ``matrix`` itself.
    """
    n = matrix.shape[0]
    sound = True
    for a in range(n):
        for b in range(a):
            total = matrix[a, b]
            for c in range(b):
                total -= root[a, c] * root[b, c]
            root[a, b] = total / root[b, b]
        pivot = matrix[a, a]
        for c in range(a):
            pivot -= root[a, c] * root[a, c]
        if not pivot > least:
            sound = False
            pivot = max(pivot, least)
        root[a, a] = math.sqrt(pivot)
    return sound


@lean
def forward(root, rows):  # type: ignore[no-untyped-def]
    """Solve root X = rows in place, rows (n, m)."""
    n, m = rows.shape
    for a in range(n):
        for b in range(a):
            factor = root[a, b]
            for c in range(m):
                rows[a, c] -= factor * rows[b, c]
        factor = 1.0 / root[a, a]
        for c in range(m):
            rows[a, c] *= factor


@lean
def backward(root, rows):  # type: ignore[no-untyped-def]
    """Solve root' X = rows in place, rows (n, m)."""
    n, m = rows.shape
    for a in range(n - 1, -1, -1):
        factor = 1.0 / root[a, a]
        for c in range(m):
            rows[a, c] *= factor
        for b in range(a):
            factor = root[a, b]
            for c in range(m):
                rows[b, c] -= factor * rows[a, c]


@lean
def all_below(matrix, bound, root):  # type: ignore[no-untyped-def]
    """Whether all eigenvalues of a symmetric matrix (n, n) are below ``bound``, in its unit: bound - matrix has a root.

    ``root`` (n, n) is overwritten.
    """
    n = matrix.shape[0]
    for a in range(n):
        if not matrix[a, a] < bound:
            return False
    for a in range(n):
        for b in range(a + 1):
            root[a, b] = -matrix[a, b]
        root[a, a] += bound
    return cholesky(root, 0.0, root)


@lean
def all_above(matrix, bound, root):  # type: ignore[no-untyped-def]
    """Whether all eigenvalues of a symmetric matrix (n, n) are above ``bound``, in its unit: matrix - bound has a root.

    ``root`` (n, n) is overwritten.
    """
    n = matrix.shape[0]
    for a in range(n):
        if not matrix[a, a] > bound:
            return False
    for a in range(n):
        for b in range(a + 1):
            root[a, b] = matrix[a, b]
        root[a, a] -= bound
    return cholesky(root, 0.0, root)


@lean
def whiten(root, matrix):  # type: ignore[no-untyped-def]
    """root^-1 matrix root^-T of a symmetric matrix (n, n), in place; ``root`` (n, n) as of ``cholesky``."""
    n = matrix.shape[0]
    forward(root, matrix)
    for a in range(n):
        for b in range(a):
            matrix[a, b], matrix[b, a] = matrix[b, a], matrix[a, b]
    forward(root, matrix)
    for a in range(n):
        for b in range(a):
            matrix[a, b] = matrix[b, a] = 0.5 * (matrix[a, b] + matrix[b, a])


@lean
def product(left, right, out):  # type: ignore[no-untyped-def]
    """out = left right, (n, k) (k, m)."""
    out[:, :] = 0.0
    for a in range(left.shape[0]):
        for b in range(left.shape[1]):
            factor = left[a, b]
            for c in range(right.shape[1]):
                out[a, c] += factor * right[b, c]


@lean
def congruence(left, middle, half, out):  # type: ignore[no-untyped-def]
    """out = left middle left' of a symmetric ``middle``, all (n, n), symmetric to the last digit; ``half`` is room for
    left middle."""
    product(left, middle, half)
    n = left.shape[0]
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for c in range(n):
                total += half[a, c] * left[b, c]
            out[a, b] = total
            out[b, a] = total


@lean
def invert(matrix, out):  # type: ignore[no-untyped-def]
    """Inverse of a symmetric matrix (n, n) that is positive definite but for rounding, by L D L', into ``out`` (n, n).

    ``matrix`` is overwritten; the unit of the result is one over its.

    Where a pivot is zero the result is not finite.
    """
    n = matrix.shape[0]
    for a in range(n):
        for b in range(n):
            out[a, b] = 1.0 if a == b else 0.0
    for a in range(n):
        reciprocal = 1.0 / matrix[a, a]
        for b in range(a + 1, n):
            factor = matrix[b, a] * reciprocal
            for c in range(a + 1, n):
                matrix[b, c] -= factor * matrix[a, c]
            for c in range(a + 1):
                out[b, c] -= factor * out[a, c]
            matrix[b, a] = factor
    for a in range(n - 1, -1, -1):
        reciprocal = 1.0 / matrix[a, a]
        for c in range(n):
            out[a, c] *= reciprocal
        for b in range(a + 1, n):
            factor = matrix[b, a]
            for c in range(n):
                out[a, c] -= factor * out[b, c]


@lean
def solve_general(matrix, rows, n):  # type: ignore[no-untyped-def]
    """Solve matrix X = rows in place by elimination with partial pivoting; ``matrix`` is overwritten.

    Args:
        matrix, rows: (n, n) and (n, m): of both the first n rows, of the matrix the first n columns.
    """
    m = rows.shape[1]
    for a in range(n):
        best = a
        for b in range(a + 1, n):
            if abs(matrix[b, a]) > abs(matrix[best, a]):
                best = b
        if best != a:
            for c in range(n):
                matrix[a, c], matrix[best, c] = matrix[best, c], matrix[a, c]
            for c in range(m):
                rows[a, c], rows[best, c] = rows[best, c], rows[a, c]
        reciprocal = 1.0 / matrix[a, a]
        for b in range(a + 1, n):
            factor = matrix[b, a] * reciprocal
            for c in range(a + 1, n):
                matrix[b, c] -= factor * matrix[a, c]
            for c in range(m):
                rows[b, c] -= factor * rows[a, c]
    for a in range(n - 1, -1, -1):
        for b in range(a + 1, n):
            factor = matrix[a, b]
            for c in range(m):
                rows[a, c] -= factor * rows[b, c]
        reciprocal = 1.0 / matrix[a, a]
        for c in range(m):
            rows[a, c] *= reciprocal


@lean
def _tridiagonal(z, values, off):  # type: ignore[no-untyped-def]
    """Householder's reduction of z (n, n) to tridiagonal form; z becomes the vectors of it, one a row."""
    n = z.shape[0]
    for i in range(n - 1, 0, -1):
        scale = 0.0
        for k in range(i):
            scale += abs(z[i, k])
        if i == 1 or scale == 0.0:
            off[i] = z[i, i - 1]
            values[i] = 0.0
            continue
        h = 0.0
        for k in range(i):
            z[i, k] /= scale
            h += z[i, k] * z[i, k]
        f = z[i, i - 1]
        g = -math.copysign(math.sqrt(h), f)
        off[i] = scale * g
        h -= f * g
        z[i, i - 1] = f - g
        for j in range(i):
            total = 0.0
            for k in range(i):
                total += z[j, k] * z[i, k]
            off[j] = total / h
        f = 0.0
        for j in range(i):
            f += off[j] * z[i, j]
        share = f / (h + h)
        for j in range(i):
            off[j] -= share * z[i, j]
        for j in range(i):
            f, g = z[i, j], off[j]
            for k in range(i):
                z[j, k] -= f * off[k] + g * z[i, k]
        values[i] = h
    values[0] = off[0] = 0.0


@lean
def _accumulate(z, values, work):  # type: ignore[no-untyped-def]
    """The transformation Q' (n, n) of ``_tridiagonal`` in the place of its Householder vectors; diagonal in values."""
    n = z.shape[0]
    for i in range(n):
        h = values[i]
        if h != 0.0:
            # P = 1 - u u' / h from the right of Q' (i, i), whose rows are z[:i, :i].
            for k in range(i):
                work[k] = z[i, k]
            for j in range(i):
                total = 0.0
                for k in range(i):
                    total += z[j, k] * work[k]
                total /= h
                for k in range(i):
                    z[j, k] -= total * work[k]
        values[i] = z[i, i]
        z[i, i] = 1.0
        for k in range(i):
            z[i, k] = 0.0
            z[k, i] = 0.0


@lean
def eigen(z, values, off, work):  # type: ignore[no-untyped-def]
    """Eigenvalues and eigenvectors of a symmetric matrix: Householder's reduction, then implicit QL steps.

    Args:
        z: the matrix, (n, n); its rows become the eigenvectors.
        values: becomes the eigenvalues, ascending, (n,).
        off, work: room, (n,) each.
    """
    n = z.shape[0]
    _tridiagonal(z, values, off)
    _accumulate(z, values, work)
    for i in range(1, n):
        off[i - 1] = off[i]
    off[n - 1] = 0.0
    for first in range(n):
        for _ in range(MOST_SWEEPS):
            last = first
            while last < n - 1 and abs(off[last]) > 1.1e-16 * (abs(values[last]) + abs(values[last + 1])):
                last += 1
            if last == first:
                break
            g = (values[first + 1] - values[first]) / (2.0 * off[first])
            r = math.sqrt(g * g + 1.0)
            g = values[last] - values[first] + off[first] / (g + math.copysign(r, g))
            sine = cosine = 1.0
            shift = 0.0
            for i in range(last - 1, first - 1, -1):
                f, b = sine * off[i], cosine * off[i]
                r = math.sqrt(f * f + g * g)
                off[i + 1] = r
                if r == 0.0:
                    values[i + 1] -= shift
                    off[last] = 0.0
                    break
                sine, cosine = f / r, g / r
                g = values[i + 1] - shift
                r = (values[i] - g) * sine + 2.0 * cosine * b
                shift = sine * r
                values[i + 1] = g + shift
                g = cosine * r - b
                for k in range(n):
                    x, y = z[i + 1, k], z[i, k]
                    z[i + 1, k] = sine * y + cosine * x
                    z[i, k] = cosine * y - sine * x
            else:
                values[first] -= shift
                off[first] = g
                off[last] = 0.0
    for i in range(n - 1):
        least = i
        for k in range(i + 1, n):
            if values[k] < values[least]:
                least = k
        if least != i:
            values[i], values[least] = values[least], values[i]
            for k in range(n):
                z[i, k], z[least, k] = z[least, k], z[i, k]
