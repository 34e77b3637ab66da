"""The standard atmosphere's density, whole and expanded about a nearby altitude, compiled."""

import math

from wingwatch.aircraft import GRAVITY_M_S2
from wingwatch.kernels.decorators import helper

__all__ = ["CELL_M", "air_density", "expand_density"]

_SEA_LEVEL_K, _LAPSE_K_M, _SEA_LEVEL_PA, _GAS = 288.15, 0.0065, 101325.0, 287.05287
_TROPOPAUSE_M = 11000.0
_TROPOPAUSE_K = _SEA_LEVEL_K - _LAPSE_K_M * _TROPOPAUSE_M
_EXPONENT = GRAVITY_M_S2 / (_GAS * _LAPSE_K_M)
_TROPOPAUSE_DENSITY = _SEA_LEVEL_PA * (_TROPOPAUSE_K / _SEA_LEVEL_K) ** _EXPONENT / (_GAS * _TROPOPAUSE_K)

CELL_M = 10.0
"""Width of the cells that ``expand_density`` divides the altitude into; the tropopause is an edge."""


@helper
def air_density(altitude_m):  # type: ignore[no-untyped-def]
    """Density in kg/m3 of the standard atmosphere up to 20000 m (ISO 2533, as ``aircraft.isa_density_kg_m3``)."""
    if altitude_m <= _TROPOPAUSE_M:
        kelvin = _SEA_LEVEL_K - _LAPSE_K_M * altitude_m
        return _SEA_LEVEL_PA / (_GAS * kelvin) * math.exp(_EXPONENT * math.log(kelvin / _SEA_LEVEL_K))
    return _TROPOPAUSE_DENSITY * math.exp(
        -GRAVITY_M_S2 * (altitude_m - _TROPOPAUSE_M) / (_GAS * _TROPOPAUSE_K)
    )


@helper
def expand_density(altitude_m):  # type: ignore[no-untyped-def]
    """(centre in m, a, b, c): density is a + d (b + d c), d the altitude less the centre of its cell of ``CELL_M``.

    Taylor's series to the second order. Below the tropopause density goes with kelvin^n, n = 4.256; the first term left
    out is n (n-1) (n-2)/6 x^3 = 5.2 x^3 with x = 0.0065 K/m x 5 m / 217 K or less at the edge of a cell: 2e-11 of the
    density. Above it goes with e^-y: y^3/6, y = 5 m / 6342 m, 8e-11.
    """
    centre = CELL_M * math.floor(altitude_m / CELL_M) + 0.5 * CELL_M
    density = air_density(centre)
    if centre <= _TROPOPAUSE_M:
        per_m = -_LAPSE_K_M / (_SEA_LEVEL_K - _LAPSE_K_M * centre)
        n = _EXPONENT - 1.0
        return centre, density, density * n * per_m, density * 0.5 * n * (n - 1.0) * per_m * per_m
    per_m = -GRAVITY_M_S2 / (_GAS * _TROPOPAUSE_K)
    return centre, density, density * per_m, density * 0.5 * per_m * per_m
