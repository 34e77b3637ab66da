"""Sets of causes that no flight can tell apart, whatever is flown."""

from wingwatch.diagnosis.candidate import Subject
from wingwatch.diagnosis.result import NotSeparable

__all__ = ["not_separable"]


def not_separable(subject: Subject) -> tuple[NotSeparable, ...]:
    """Those that concern this aircraft and this flight."""
    sets = [
        NotSeparable(
            ("sensor_delay of all channels", "surfaces that are recorded early"),
            "only times between channels show: a delay common to all outputs is the inputs' own",
        ),
        NotSeparable(
            ("mass_inertia", "thrust and all coefficients"),
            "motion shows forces over mass: mass, thrust and every coefficient changed alike leave it as it is",
        ),
        NotSeparable(
            ("airspeed_error", "air density and all coefficients"),
            "forces show the dynamic pressure times the coefficients, and the airspeed's reading times its scale",
        ),
    ]
    if subject.measures("angle_of_attack_rad"):
        sets.append(
            NotSeparable(
                ("vane_upwash[angle_of_attack]", "derivatives z_w and m_w together"),
                "the vane alone says what the angle of attack is: a vane that turns too far and slopes of lift "
                "and moment that are too small differ only in the geometry of the flight path",
            )
        )
    if not any(subject.measures(name) for name in ("elevator_rad", "aileron_rad", "rudder_rad")):
        sets.append(
            NotSeparable(
                ("elevator_effectiveness", "sensor_scale of the surface's reading"),
                "without command and position a surface that reads too much is one that does too little",
            )
        )
    return tuple(sets)
