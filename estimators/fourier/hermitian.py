"""Inverses of small Hermitian matrices, bins side by side; compiled.

Real and imaginary parts lie apart, (rows, rows, 2, bins).
"""

from wingwatch.kernels.decorators import lean

__all__ = ["condition_on_last", "invert_2", "invert_3", "join_last"]


@lean
def invert_2(weights, determinant):  # type: ignore[no-untyped-def]
    """Inverse of Hermitian 2 x 2 matrices in place from their upper triangles; ``determinant`` (bins,) is multiplied by
    that of each inverse."""
    for f in range(weights.shape[3]):
        a, d = weights[0, 0, 0, f], weights[1, 1, 0, f]
        x, y = weights[0, 1, 0, f], weights[0, 1, 1, f]
        over = 1.0 / (a * d - (x * x + y * y))
        determinant[f] *= over
        weights[0, 0, 0, f] = d * over
        weights[1, 1, 0, f] = a * over
        weights[0, 1, 0, f] = weights[1, 0, 0, f] = -x * over
        weights[0, 1, 1, f] = -y * over
        weights[1, 0, 1, f] = y * over


@lean
def invert_3(weights, determinant):  # type: ignore[no-untyped-def]
    """The same for 3 x 3, by cofactors: ``weights`` (3, 3, 2, bins), real and imaginary parts."""
    for f in range(weights.shape[3]):
        a, b, c = weights[0, 0, 0, f], weights[1, 1, 0, f], weights[2, 2, 0, f]
        xr, xi = weights[0, 1, 0, f], weights[0, 1, 1, f]
        yr, yi = weights[0, 2, 0, f], weights[0, 2, 1, f]
        zr, zi = weights[1, 2, 0, f], weights[1, 2, 1, f]
        aa = b * c - (zr * zr + zi * zi)
        bb = a * c - (yr * yr + yi * yi)
        cc = a * b - (xr * xr + xi * xi)
        pr, pi = yr * zr + yi * zi - xr * c, yi * zr - yr * zi - xi * c
        qr, qi = xr * zr - xi * zi - yr * b, xr * zi + xi * zr - yi * b
        ur, ui = yr * xr + yi * xi - a * zr, yi * xr - yr * xi - a * zi
        over = 1.0 / (a * aa + xr * pr + xi * pi + yr * qr + yi * qi)
        determinant[f] *= over
        weights[0, 0, 0, f], weights[1, 1, 0, f], weights[2, 2, 0, f] = aa * over, bb * over, cc * over
        weights[0, 1, 0, f] = weights[1, 0, 0, f] = pr * over
        weights[0, 2, 0, f] = weights[2, 0, 0, f] = qr * over
        weights[1, 2, 0, f] = weights[2, 1, 0, f] = ur * over
        weights[0, 1, 1, f], weights[1, 0, 1, f] = pi * over, -pi * over
        weights[0, 2, 1, f], weights[2, 0, 1, f] = qi * over, -qi * over
        weights[1, 2, 1, f], weights[2, 1, 1, f] = ui * over, -ui * over


@lean
def condition_on_last(weights):  # type: ignore[no-untyped-def]
    """Covariance of all rows but the last given the last, in place; the last column becomes the regression on it.

    ``weights``: (rows, rows, 2, bins), real and imaginary parts.
    """
    last = weights.shape[0] - 1
    for k in range(last):
        a, b, own = weights[k, last, 0], weights[k, last, 1], weights[last, last, 0]
        for f in range(own.size):
            over = 1.0 / own[f]
            a[f] *= over
            b[f] *= over
        real = weights[k, k, 0]
        for f in range(own.size):
            real[f] -= (a[f] * a[f] + b[f] * b[f]) * own[f]
        for m in range(k + 1, last):
            c, d, real, imaginary = (
                weights[m, last, 0],
                weights[m, last, 1],
                weights[k, m, 0],
                weights[k, m, 1],
            )
            for f in range(own.size):
                real[f] -= a[f] * c[f] + b[f] * d[f]
                imaginary[f] -= b[f] * c[f] - a[f] * d[f]


@lean
def join_last(weights):  # type: ignore[no-untyped-def]
    """W of all rows from that of the others given the last, and the regression on it (block inverse), in place.

    ``weights``: (rows, rows, 2, bins), real and imaginary parts.
    """
    last = weights.shape[0] - 1
    own = weights[last, last, 0]
    for f in range(own.size):
        own[f] = 1.0 / own[f]
    for k in range(last):
        # W_kl = -sum_m W_km g_m, g the regression; W_ll = 1 / S_ll + g' W g.
        real, imaginary, x, y = (
            weights[last, k, 0],
            weights[last, k, 1],
            weights[k, last, 0],
            weights[k, last, 1],
        )
        for f in range(own.size):
            real[f] = imaginary[f] = 0.0
        for m in range(last):
            a, b, c, d = weights[k, m, 0], weights[k, m, 1], weights[m, last, 0], weights[m, last, 1]
            for f in range(own.size):
                real[f] -= a[f] * c[f] - b[f] * d[f]
                imaginary[f] += a[f] * d[f] + b[f] * c[f]
        for f in range(own.size):
            own[f] += y[f] * imaginary[f] - x[f] * real[f]
    for k in range(last):
        for f in range(own.size):
            weights[k, last, 0, f], weights[k, last, 1, f] = weights[last, k, 0, f], -weights[last, k, 1, f]
            weights[last, last, 1, f] = 0.0
