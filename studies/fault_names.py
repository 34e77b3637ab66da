"""What a fault is called: the kind of its alert, the part that it befalls, and which alert names it rightly."""

from collections.abc import Mapping

__all__ = ["KINDS_OF_FAULT", "PARTS", "SENSOR_EFFECTS", "kind_of", "names_rightly", "part_of", "parts_of"]

KINDS_OF_FAULT = ("icing", "damage", "sensor")
"""Kinds of alerts that name a fault."""

SENSOR_EFFECTS = (
    "sensor_bias", "sensor_scale", "sensor_delay", "sensor_freeze", "airspeed_error", "vane_upwash",
)  # fmt: skip
"""Simulated effects that leave the aircraft as it is: a sensor is at fault."""

_SURFACE_EFFECTS = (
    "surface_stuck",
    "surface_offset",
    "actuator_lag",
    "actuator_rate_limit",
    "actuator_backlash",
)
_PART_OF: Mapping[str, str] = {"airspeed_error": "airspeed_true_m_s", "thrust_loss": "throttle"}
_ALIKE: Mapping[tuple[str, str], str] = {
    ("sensor_scale", "airspeed_true_m_s"): "airspeed_error",
    ("vane_upwash", "angle_of_attack_rad"): "sensor_scale",
    ("vane_upwash", "sideslip_rad"): "sensor_scale",
}
"""Causes that are the same to every reading: a vane in upwash reads a multiple of the flow's angle."""

PARTS: Mapping[str, tuple[str, ...]] = {
    "surfaces": ("elevator_rad", "aileron_rad", "rudder_rad"),
    "thrust": ("throttle",),
    "gyros": ("roll_rate_rad_s", "pitch_rate_rad_s", "yaw_rate_rad_s"),
    "accelerometers": ("specific_force_x_m_s2", "specific_force_y_m_s2", "specific_force_z_m_s2"),
    "vanes": ("angle_of_attack_rad", "sideslip_rad"),
    "attitude": ("roll_rad", "pitch_rad", "heading_rad"),
    "airspeed": ("airspeed_true_m_s",),
}
"""Channels that are reported together."""


def kind_of(effect: str) -> str:
    """``icing``, ``damage`` or ``sensor``: the kind that an alert about a simulated effect should have."""
    return "icing" if effect == "icing" else "sensor" if effect in SENSOR_EFFECTS else "damage"


def part_of(effect: str, target: str) -> str:
    """The channel of the flight table that an effect is about; empty for the airframe."""
    if effect in _PART_OF:
        return _PART_OF[effect]
    if effect in _SURFACE_EFFECTS or effect == "vane_upwash":
        return f"{target}_rad"
    return target if effect in SENSOR_EFFECTS else ""


def parts_of(channel: str) -> str:
    """The group of channels that one belongs to: ``airframe`` without a channel, itself where it is in none."""
    return next((name for name, channels in PARTS.items() if channel in channels), channel or "airframe")


def names_rightly(effect: str, target: str, cause: str, channel: str | None) -> bool:
    """Whether a cause and its channel are the simulated effect: both of a part, the cause alone of the airframe.

    Every kind of ice is ``icing``.
    """
    part = part_of(effect, target)
    if part == "":
        return cause == effect
    return channel == part and cause in (effect, _ALIKE.get((effect, part)))
