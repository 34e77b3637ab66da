"""What noise does to the equations of the recursive Fourier estimator, and the weights of its bins; compiled.

Derivation and symbols: ``docs/estimators.md`` section 4. The noise transfer is a line in s, L = L0 + s L1, so what it
makes of white noise is a polynomial, and of the weights only a few sums over the bins are needed.
"""

from wingwatch.estimators.hot import lean

__all__ = ["bin_weights", "channel_level", "invert_weights"]


@lean
def channel_level(noise, j, ns):  # type: ignore[no-untyped-def]
    """Noise variance of the measured channel j (states, accelerometer, inputs) in the vector of all variances."""
    return noise[j] if j <= ns else noise[ns + j]


@lean
def _transfer(theta, scale, forward_speed, lever, by_accelerometer, ns, nu, transfer):  # type: ignore[no-untyped-def]
    """L0 and L1 into ``transfer`` (2, ns, ns + 1 + nu): n states, accelerometer, inputs."""
    nd = ns + nu
    transfer[:, :, :] = 0.0
    for k in range(ns):
        for j in range(nd):
            transfer[0, k, j if j < ns else j + 1] = -theta[k * nd + j] * scale[k * nd + j]
        if k > 0 or not by_accelerometer:
            transfer[1, k, k] = 1.0
    if by_accelerometer:
        transfer[0, 0, ns] = 1.0
        for j in range(1, ns):
            transfer[1, 0, j] += lever[j]
    else:
        for j in range(1, ns):
            transfer[0, 0, j] -= forward_speed[j]


@lean
def _invert_2(weights):  # type: ignore[no-untyped-def]
    """Inverse of Hermitian 2 x 2 matrices in place, (2, 2, 2, frequencies), from their upper triangles."""
    for f in range(weights.shape[3]):
        a, d = weights[0, 0, 0, f], weights[1, 1, 0, f]
        x, y = weights[0, 1, 0, f], weights[0, 1, 1, f]
        share = 1.0 / (a * d - (x * x + y * y))
        weights[0, 0, 0, f] = d * share
        weights[1, 1, 0, f] = a * share
        weights[0, 1, 0, f] = weights[1, 0, 0, f] = -x * share
        weights[0, 1, 1, f] = -y * share
        weights[1, 0, 1, f] = y * share


@lean
def _invert_3(weights):  # type: ignore[no-untyped-def]
    """The same for 3 x 3, by cofactors."""
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
        share = 1.0 / (a * aa + xr * pr + xi * pi + yr * qr + yi * qi)
        weights[0, 0, 0, f], weights[1, 1, 0, f], weights[2, 2, 0, f] = aa * share, bb * share, cc * share
        weights[0, 1, 0, f] = weights[1, 0, 0, f] = pr * share
        weights[0, 2, 0, f] = weights[2, 0, 0, f] = qr * share
        weights[1, 2, 0, f] = weights[2, 1, 0, f] = ur * share
        weights[0, 1, 1, f], weights[1, 0, 1, f] = pi * share, -pi * share
        weights[0, 2, 1, f], weights[2, 0, 1, f] = qi * share, -qi * share
        weights[1, 2, 1, f], weights[2, 1, 1, f] = ui * share, -ui * share


@lean
def invert_weights(weights):  # type: ignore[no-untyped-def]
    """Inverse of Hermitian matrices in place, (ns, ns, 2, frequencies), from their upper triangles."""
    if weights.shape[0] == 2:
        _invert_2(weights)
    else:
        _invert_3(weights)


@lean
def bin_weights(  # type: ignore[no-untyped-def]
    omega,
    theta,
    scale,
    noise,
    power,
    forward_speed,
    lever,
    by_accelerometer,
    ns,
    nu,
    transfer,
    weights,
    moments,
):
    """The noise transfer, and the weight of every bin, W = Sigma^-1.

    The equation error of row k is sum_j L[k, j] n_j plus the equation's own noise, n the noise of the measured states,
    of the accelerometer and of the inputs. The errors of both end points, which come with a rate, are the same numbers
    in all bins and no noise of theirs: two columns.

    Args:
        transfer: becomes L0 and L1, (2, ns, ns + 1 + nu).
        weights: becomes W, (ns, ns, 2, frequencies), its real and imaginary part.
        moments: becomes the sums over bins of Re W, of omega Im W and of omega^2 Re W, (3, ns, ns).
    """
    _transfer(theta, scale, forward_speed, lever, by_accelerometer, ns, nu, transfer)
    for k in range(ns):
        for m in range(k, ns):
            flat = turning = rising = 0.0
            for j in range(ns + 1 + nu):
                level = power * channel_level(noise, j, ns)
                flat += level * transfer[0, k, j] * transfer[0, m, j]
                turning += level * (
                    transfer[1, k, j] * transfer[0, m, j] - transfer[0, k, j] * transfer[1, m, j]
                )
                rising += level * transfer[1, k, j] * transfer[1, m, j]
            if k == m:
                flat += power * noise[ns + 1 + k]
            real, imaginary = weights[k, m, 0], weights[k, m, 1]
            for f in range(omega.size):
                real[f] = flat + omega[f] * omega[f] * rising
                imaginary[f] = omega[f] * turning
    invert_weights(weights)
    for k in range(ns):
        for m in range(ns):
            real, imaginary = weights[k, m, 0], weights[k, m, 1]
            flat = turning = rising = 0.0
            for f in range(omega.size):
                flat += real[f]
                turning += omega[f] * imaginary[f]
                rising += omega[f] * omega[f] * real[f]
            moments[0, k, m], moments[1, k, m], moments[2, k, m] = flat, turning, rising
