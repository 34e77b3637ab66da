"""The International Standard Atmosphere (ISO 2533:1975) and the airspeeds that depend on it.

Altitude is taken as geopotential pressure altitude. Every function takes scalars or arrays of any shape and
returns float64 arrays of that shape; outside -5000 m to 47000 m, where the layers below are not defined, the
answer is NaN.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "GRAVITY_M_S2",
    "SEA_LEVEL_DENSITY_KG_M3",
    "air_density_kg_m3",
    "isa_density_kg_m3",
    "isa_pressure_pa",
    "isa_temperature_k",
    "true_from_indicated",
]

GRAVITY_M_S2 = 9.80665
GAS_CONSTANT_J_KG_K = 287.05287
SEA_LEVEL_DENSITY_KG_M3 = 1.225

_BASE_ALTITUDE_M = np.array([0.0, 11_000.0, 20_000.0, 32_000.0])
_LAPSE_K_M = np.array([-6.5e-3, 0.0, 1.0e-3, 2.8e-3])
_LOWEST_M, _HIGHEST_M = -5_000.0, 47_000.0


def _layer_bases() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Temperature in K and pressure in Pa at the base of each layer."""
    temperature, pressure = [288.15], [101_325.0]
    for i, thickness in enumerate(np.diff(_BASE_ALTITUDE_M)):
        bottom, lapse = temperature[-1], float(_LAPSE_K_M[i])
        top = bottom + lapse * float(thickness)
        exponent = -GRAVITY_M_S2 / GAS_CONSTANT_J_KG_K
        ratio = (
            np.exp(exponent * thickness / bottom) if lapse == 0.0 else (top / bottom) ** (exponent / lapse)
        )
        temperature.append(top)
        pressure.append(pressure[-1] * float(ratio))
    return np.array(temperature), np.array(pressure)


_BASE_TEMPERATURE_K, _BASE_PRESSURE_PA = _layer_bases()


def _layer(altitude_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    altitude = np.asarray(altitude_m, dtype=np.float64)
    altitude = np.where((altitude >= _LOWEST_M) & (altitude <= _HIGHEST_M), altitude, np.nan)
    return altitude, np.clip(np.searchsorted(_BASE_ALTITUDE_M, altitude, side="right") - 1, 0, 3)


def isa_temperature_k(altitude_m: ArrayLike) -> NDArray[np.float64]:
    """Standard temperature in K at an altitude in m (ISO 2533)."""
    altitude, layer = _layer(altitude_m)
    return np.asarray(_BASE_TEMPERATURE_K[layer] + _LAPSE_K_M[layer] * (altitude - _BASE_ALTITUDE_M[layer]))


def isa_pressure_pa(altitude_m: ArrayLike) -> NDArray[np.float64]:
    """Standard pressure in Pa at an altitude in m (ISO 2533)."""
    altitude, layer = _layer(altitude_m)
    base, lapse = _BASE_TEMPERATURE_K[layer], _LAPSE_K_M[layer]
    height = altitude - _BASE_ALTITUDE_M[layer]
    exponent = -GRAVITY_M_S2 / GAS_CONSTANT_J_KG_K
    safe_lapse = np.where(lapse == 0.0, 1.0, lapse)
    ratio = np.where(
        lapse == 0.0,
        np.exp(exponent * height / base),
        (1.0 + lapse * height / base) ** (exponent / safe_lapse),
    )
    return np.asarray(_BASE_PRESSURE_PA[layer] * ratio)


def air_density_kg_m3(pressure_pa: ArrayLike, temperature_k: ArrayLike) -> NDArray[np.float64]:
    """Density in kg/m3 of dry air from pressure in Pa and temperature in K (ideal gas)."""
    return np.asarray(np.asarray(pressure_pa) / (GAS_CONSTANT_J_KG_K * np.asarray(temperature_k)))


def isa_density_kg_m3(altitude_m: ArrayLike) -> NDArray[np.float64]:
    """Standard density in kg/m3 at an altitude in m (ISO 2533)."""
    return air_density_kg_m3(isa_pressure_pa(altitude_m), isa_temperature_k(altitude_m))


def true_from_indicated(
    airspeed_indicated_m_s: ArrayLike, air_density_kg_m3: ArrayLike
) -> NDArray[np.float64]:
    """True airspeed in m/s from indicated airspeed in m/s at an air density in kg/m3.

    Incompressible flow: the dynamic pressure is the same, so the ratio is the square root of the density
    ratio. Compressibility adds M^2/8 of the airspeed (0.1 % at 30 m/s), far below any probe's error here.
    """
    return np.asarray(
        np.asarray(airspeed_indicated_m_s, dtype=np.float64)
        * np.sqrt(SEA_LEVEL_DENSITY_KG_M3 / np.asarray(air_density_kg_m3, dtype=np.float64))
    )
