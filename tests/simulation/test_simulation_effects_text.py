"""Effects as text: the vocabulary is whole, text is read or refused in one sentence, and comes back as it was."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wingwatch.aircraft import ICING_SEVERITY_MAX
from wingwatch.simulation import (
    EFFECTS,
    AileronEffectiveness,
    Effect,
    EffectSyntaxError,
    ElevatorEffectiveness,
    Icing,
    MassInertia,
    RudderEffectiveness,
    SensorBias,
    SensorFreeze,
    SurfaceStuck,
    effect_text,
    parse_effect,
)

VOCABULARY = [
    "icing", "elevator_effectiveness", "aileron_effectiveness", "rudder_effectiveness", "surface_stuck",
    "surface_offset", "wing_damage", "cg_shift", "mass_inertia", "pitch_damping", "incidence_nonlinearity",
    "downwash_lag", "roll_yaw_coupling", "actuator_lag", "actuator_rate_limit", "actuator_backlash",
    "thrust_effect", "thrust_loss", "sensor_delay", "sensor_bias", "sensor_scale", "sensor_freeze",
    "sensor_position", "airspeed_error", "vane_upwash", "turbulence", "derivative",
]  # fmt: skip
"""The causes of the contract but for ``unknown``, and ``sensor_freeze``, which nobody diagnoses."""

PAYLOAD = "payload,0.1,-0.5,0.05"


def test_names_are_those_of_the_causes() -> None:
    assert list(EFFECTS) == VOCABULARY
    assert all(name == effect.name for name, effect in EFFECTS.items())


@pytest.mark.parametrize(
    ("text", "effect"),
    [
        ("icing:0.15@60+30", Icing(0.15, 60.0, 30.0)),
        ("icing[all]:0.15@60+30", Icing(0.15, 60.0, 30.0)),
        ("icing[tail]:0.1@60+30", Icing(0.1, 60.0, 30.0, "tail")),
        ("elevator_effectiveness:0.5@90", ElevatorEffectiveness(0.5, 90.0)),
        (" rudder_effectiveness:1@0+0 ", RudderEffectiveness(1.0)),
        ("aileron_effectiveness:0.25@1e1", AileronEffectiveness(0.25, 10.0)),
        ("sensor_bias[pitch_rate_rad_s]:-0.01@60", SensorBias(-0.01, 60.0, 0.0, "pitch_rate_rad_s")),
        ("sensor_freeze[altitude_m]:1@60", SensorFreeze(1.0, 60.0, 0.0, "altitude_m")),
        ("surface_stuck[elevator]:here@40", SurfaceStuck(math.nan, 40.0, 0.0, "elevator")),
        ("surface_stuck[rudder]:-limit@40", SurfaceStuck(-math.inf, 40.0, 0.0, "rudder")),
        (f"mass_inertia[{PAYLOAD}]:-0.2@5", MassInertia(-0.2, 5.0, 0.0, PAYLOAD)),
    ],
)
def test_effects_are_read_from_text(text: str, effect: Effect) -> None:
    assert parse_effect(text) == effect


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("frost:0.1@3", r"'frost' cannot be simulated; known are icing, elevator_effectiveness"),
        ("unknown:0.1@3", r"'unknown' cannot be simulated"),
        ("", r"'' cannot be simulated"),
        ("[tail]:0.1@3", r"'' cannot be simulated"),
        ("icing", r"has no size; write NAME:SIZE@START"),
        ("icing:0.1", r"has no start; write NAME:SIZE@START"),
        ("icing:lots@3", r"size 'lots' is not a number"),
        ("icing:here@3", r"size 'here' is not a number"),
        ("icing:0.1@", r"start '' is not a number"),
        ("icing:0.1@3+", r"ramp '' is not a number"),
        ("icing:0.5@3", r"size 0.5; give the severity eta, 0 to 0.4"),
        ("icing:nan@3", r"size nan"),
        ("icing:inf@3", r"size inf"),
        ("elevator_effectiveness:-0.1@3", r"size -0.1; give the fraction lost, 0 to 1"),
        ("icing:0.1@-3", r"start -3.0 s"),
        ("icing:0.1@3+inf", r"ramp inf s"),
        ("icing[fin]:0.1@3", r"icing of 'fin' cannot be simulated; give one of all, wing, tail, nonlinear"),
        ("icing[tail:0.1@3", r"'\[tail:0.1@3' is out of place; write NAME"),
        ("icing[tail]0.1@3", r"'0.1@3' is out of place; write NAME"),
        (
            "surface_stuck:0.1@3",
            r"surface_stuck of nothing cannot be simulated; give one of elevator, aileron",
        ),
        (
            "surface_stuck[elevator]:2@3",
            r"give the deflection in rad, -1.6 to 1.6, or here, or limit, or -limit",
        ),
        ("surface_stuck[elevator]:0@3+2", r"has ramp 2.0 s, but is there at once"),
        ("sensor_bias[mood]:0.1@3", r"of 'mood' cannot be simulated; give one of airspeed_true_m_s"),
        ("sensor_freeze[altitude_m]:0.5@3", r"size 0.5; give 1, for a reading is frozen or is not$"),
        ("sensor_freeze[altitude_m]:1@3+2", r"has ramp 2.0 s, but is there at once"),
        ("sensor_freeze:1@3", r"sensor_freeze of nothing cannot be simulated; give one of airspeed_true_m_s"),
        ("cg_shift[wing]:0.1@3", r"cg_shift of 'wing' cannot be simulated; it takes no target"),
        ("mass_inertia[payload,1,2]:-0.1@3", r"give one of all, payload, payload,X,Y,Z"),
        ("mass_inertia[payload,1,2,inf]:-0.1@3", r"give one of all, payload, payload,X,Y,Z"),
        ("mass_inertia[payload,1,2,x]:-0.1@3", r"give one of all, payload, payload,X,Y,Z"),
        ("derivative[x_u]:0.1@3", r"of 'x_u' cannot be simulated; give one of z_w"),
    ],
)
def test_text_that_is_no_effect_is_refused_in_one_sentence(text: str, says: str) -> None:
    with pytest.raises(EffectSyntaxError, match=says) as caught:
        parse_effect(text)
    assert "\n" not in str(caught.value)
    assert repr(text) in str(caught.value)


@st.composite
def effects(draw: st.DrawFn) -> Effect:
    kind = draw(st.sampled_from(list(EFFECTS.values())))
    sizes = st.floats(kind.size_min, kind.size_max)
    if kind.size_words:
        sizes |= st.sampled_from(list(kind.size_words.values()))
    targets = [t for t in kind.targets if " " not in t] or [""]
    seconds = st.floats(0.0, allow_infinity=False, allow_nan=False)
    return kind(
        draw(sizes),
        draw(seconds),
        draw(seconds) if kind.grows else 0.0,
        draw(st.sampled_from([*targets, PAYLOAD] if kind is MassInertia else targets)),
    )


@given(effects())
def test_an_effect_comes_back_from_its_text(effect: Effect) -> None:
    text = effect_text(effect)
    assert parse_effect(text) == effect
    assert effect_text(parse_effect(text)) == text


def test_texts_are_as_a_person_writes_them() -> None:
    assert effect_text(Icing(0.15, 60.0, 30.0)) == "icing:0.15@60+30"
    assert effect_text(SurfaceStuck(math.nan, 40.0, target="elevator")) == "surface_stuck[elevator]:here@40"
    assert effect_text(Icing(ICING_SEVERITY_MAX, 1e22, target="tail")) == "icing[tail]:0.4@1e22"
