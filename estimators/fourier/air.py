"""What the bank of the recursive Fourier estimator follows beside states, forces and surfaces; compiled.

Products of all that acts with its growth, the kinematic term and the known angular accelerations. Derivation and
symbols: ``docs/methods/fourier.md``. Arrays are those of one vehicle, all memory is the caller's.
"""

from wingwatch.estimators.fourier.bank import (
    NUISANCE,
    TURN_LAG,
    TURN_SIZE,
    VANE_LEAD,
    advance_linear,
    bank_channels,
)
from wingwatch.estimators.fourier.state import AIRSPEED, CONDITION, DENSITY, LAST, SAMPLES, START
from wingwatch.estimators.signals import CONDITION_COLUMNS
from wingwatch.kernels.decorators import lean

__all__ = ["advance_air", "air_channels", "present_regressors", "product_channel", "rebase_products"]


@lean
def product_channel(ns, nu):  # type: ignore[no-untyped-def]
    """First product, of a block's transforms. The kinematic term and the known moments follow the products."""
    return ns + 2 * nu + 1 + NUISANCE


@lean
def air_channels(ns, nu):  # type: ignore[no-untyped-def]
    """Channels that this module adds to the bank: products of all that acts, kinematic term, known moments."""
    return (ns + nu) + 1 + (ns - 1)


@lean
def _growth(row, start, exponent, condition):  # type: ignore[no-untyped-def]
    """How much what acts has grown since the block began: rho V for states, rho V^2 for inputs (table B.3), less 1."""
    speed = row[condition + AIRSPEED] / max(start[condition + AIRSPEED], 1.0)
    pressure = row[condition + DENSITY] / start[condition + DENSITY] * speed
    return (pressure if exponent == 1.0 else pressure * speed) - 1.0


@lean
def advance_air(exponents, coefficients, bank, rows, new, ns):  # type: ignore[no-untyped-def]
    """One sample on: products of all that acts with its growth, and what is known of the rates.

    What acts changes with the airspeed within a block: states and inputs times ``_growth`` are nothing in steady
    flight.

    Args:
        coefficients: of ``Filters``, as ``advance_bank`` has left them.
        bank: (channels, 2, bins), some of them advanced.
        rows: of ``Block``; new: signal row at the end of the step.
    """
    start, old = rows[START], rows[LAST]
    nd = exponents.size
    kinematic = 2 + nd
    condition = kinematic + CONDITION
    channel = bank_channels(ns, nd - ns)
    for c in range(nd):
        column = 1 + c if c < ns else 2 + c
        row = bank[channel + c]
        advance_linear(
            row[0],
            row[1],
            coefficients,
            old[column] * _growth(old, start, exponents[c], condition),
            new[column] * _growth(new, start, exponents[c], condition),
        )
    channel += nd
    advance_linear(bank[channel, 0], bank[channel, 1], coefficients, old[kinematic], new[kinematic])
    for j in range(1, ns):
        column = kinematic + CONDITION_COLUMNS + j - 1
        row = bank[channel + j]
        advance_linear(row[0], row[1], coefficients, old[column], new[column])


@lean
def rebase_products(bank, old_start, new_start, exponents, ns):  # type: ignore[no-untyped-def]
    """The products' growth counted from another start: 1 + growth is a ratio to the start's rho V or rho V^2.

    Args:
        bank: (channels, 2, bins) of what came since the new start, with products that count from the old one;
            the products in place.
    """
    nd = exponents.size
    condition = 2 + nd + CONDITION
    for c in range(nd):
        ratio = 1.0 + _growth(old_start, new_start, exponents[c], condition)
        plain, row = bank[c if c < ns else c + 1], bank[bank_channels(ns, nd - ns) + c]
        for part in range(2):
            for f in range(row.shape[1]):
                row[part, f] = ratio * row[part, f] + (ratio - 1.0) * plain[part, f]


@lean
def present_regressors(model, block, plant, air, believed, transforms):  # type: ignore[no-untyped-def]
    """What acts, in place of states and inputs: grown with the airspeed, and the rate relative to the air.

    Vane and accelerometer measure the gust's rate, which turns the air: -q_g is a G times the kinematic row, and noise.
    As much of it as is believed is in the regressor; the rest is left to the joint weights, which know the gust in both
    rows, and the residual stays what it is, (docs (8)).

    Args:
        plant, air, believed: of ``noise``.
        transforms: regressors of ``between_samples`` and response of ``responses``, both in place.
    """
    omega, exponents, start, sums = model.omega, model.exponents, block.rows[START], block.sums
    bank, response = transforms.regressors, transforms.response
    nd, ns = exponents.size, plant.lever.size
    condition, products = 2 + nd + CONDITION, product_channel(ns, nd - ns)
    ratio = max(start[condition + AIRSPEED], 1.0) * sums[SAMPLES] / sums[AIRSPEED]
    for c in range(nd):
        norm = (
            start[condition + DENSITY]
            * sums[SAMPLES]
            / sums[DENSITY]
            * ratio
            * (1.0 if exponents[c] == 1.0 else ratio)
        )
        row, product = bank[c if c < ns else c + 1], bank[products + c]
        for part in range(2):
            for f in range(omega.size):
                row[part, f] = norm * (row[part, f] + product[part, f])
    if response.shape[0] == ns or air.turn == 0.0:
        return
    rate, gust, nuisance = bank[ns - 1], response[ns], nd + 1
    more, later, earlier = bank[nuisance + TURN_SIZE], bank[nuisance + TURN_LAG], bank[nuisance + VANE_LEAD]
    for f in range(omega.size):
        lag = 1j * omega[f] * air.turn_s
        seen = believed[f] * complex(gust[0, f], gust[1, f])
        smoothed = seen / (1.0 + lag)
        slowed = smoothed * lag / (1.0 + lag)
        more[0, f], more[1, f] = smoothed.real, smoothed.imag
        later[0, f], later[1, f] = slowed.real, slowed.imag
        earlier[0, f], earlier[1, f] = seen.real, seen.imag
        turned = air.turn * smoothed
        rate[0, f] += turned.real
        rate[1, f] += turned.imag
        for k in range(ns):
            response[k, 0, f] += plant.derivatives[k, ns - 1] * turned.real
            response[k, 1, f] += plant.derivatives[k, ns - 1] * turned.imag
