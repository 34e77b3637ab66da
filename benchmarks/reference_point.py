"""Coefficients published about one point, as the tangent set about another."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft import Aircraft, DirectionalCoefficients, aspect_ratio, body_coefficients

__all__ = ["about_centre_of_gravity"]

_STEP = 1e-5
_Coefficients = NDArray[np.float64]


def about_centre_of_gravity(
    aircraft: Aircraft, point_m: tuple[float, float], angle_of_attack_rad: float, elevator_rad: float
) -> Aircraft:
    """An aircraft whose forces act beside the centre of gravity, with its moments about the centre of gravity.

    A force F at r adds r x F to the moments, so to Cm the share (z CX - x CZ) / c, to Cl -z CY / b, to Cn x CY / b. The
    share of pitch bends with the angle of attack and the file's Cm is straight: it is the tangent at a trim, and
    exact only there.

    Args:
        aircraft: with moments about the point.
        point_m: x and z of the point from the centre of gravity, body axes.
        angle_of_attack_rad: of the trim.
        elevator_rad: of the trim.
    """
    c, geometry = (
        aircraft.need_coefficients("a transfer of moments"),
        aircraft.need_geometry("a transfer of moments"),
    )
    x, z = point_m
    chord, span = geometry.mean_chord_m, geometry.span_m
    aspect = aspect_ratio(span, geometry.wing_area_m2)

    def share(
        alpha: float = 0.0, beta: float = 0.0, q: float = 0.0, alphadot: float = 0.0, eta: float = 0.0
    ) -> _Coefficients:
        """What is added to Cm, and CY, beside the trim."""
        k = body_coefficients(
            c,
            aspect,
            angle_of_attack_rad + alpha,
            beta,
            (0.0, q, 0.0),
            (elevator_rad + eta, 0.0, 0.0),
            alphadot,
        )
        return np.array([(z * k.CX.real - x * k.CZ.real) / chord, k.CY.real])

    def slope(at: Callable[[float], _Coefficients]) -> _Coefficients:
        return (at(_STEP) - at(-_STEP)) / (2.0 * _STEP)

    by_alpha = float(slope(lambda d: share(alpha=d))[0])
    by_elevator = float(slope(lambda d: share(eta=d))[0])
    at_trim = float(share()[0])
    pitch = c.Cm.model_copy(
        update={
            "zero": c.Cm.zero + at_trim - by_alpha * angle_of_attack_rad - by_elevator * elevator_rad,
            "alpha": c.Cm.alpha + by_alpha,
            "q": c.Cm.q + float(slope(lambda d: share(q=d))[0]),
            "alphadot": c.Cm.alphadot + float(slope(lambda d: share(alphadot=d))[0]),
            "elevator": c.Cm.elevator + by_elevator,
        }
    )
    side = c.CY.model_copy(update={"beta": float(slope(lambda d: share(beta=d))[1])})

    def turned(table: DirectionalCoefficients, arm: float) -> DirectionalCoefficients:
        return table.model_copy(
            update={key: getattr(table, key) + arm * getattr(side, key) for key in type(table).model_fields}
        )

    coefficients = c.model_copy(
        update={"Cm": pitch, "Cl": turned(c.Cl, -z / span), "Cn": turned(c.Cn, x / span)}
    )
    return aircraft.model_copy(update={"coefficients": coefficients})
