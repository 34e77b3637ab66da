"""What a file of derivatives leaves out is the record's, and an axis at rest is held, not refused."""

import numpy as np
import pytest

from wingwatch.aircraft import (
    LATERAL,
    SHORT_PERIOD,
    Aircraft,
    linearised_derivatives,
    load_aircraft,
    trimmed,
)
from wingwatch.diagnosis.linear_aircraft import concise, entry_near
from wingwatch.diagnosis.linear_model import Noise
from wingwatch.diagnosis.problem import prepare
from wingwatch.diagnosis.steady_angle import steady_angle_rad
from wingwatch.diagnosis.subject import subject_of
from wingwatch.simulation import Scenario, doublet_schedule, simulate
from wingwatch.telemetry import SampleBlock

AEROSONDE = load_aircraft("aerosonde")
assert AEROSONDE.envelope is not None
TRIM = trimmed(AEROSONDE, AEROSONDE.envelope.cruise)
FLIGHT = simulate(
    Scenario(AEROSONDE, manoeuvres=(doublet_schedule(AEROSONDE, AEROSONDE.envelope.cruise),), seed=1), 16.0
)
RESTING = (
    "roll_rate_rad_s", "yaw_rate_rad_s", "roll_rad", "sideslip_rad", "specific_force_y_m_s2", "aileron_rad",
    "rudder_rad",
)  # fmt: skip


def of_derivatives(**condition: float) -> Aircraft:
    """A file with nothing but the derivatives of the cruise."""
    stated = linearised_derivatives(AEROSONDE, TRIM, SHORT_PERIOD) | linearised_derivatives(
        AEROSONDE, TRIM, LATERAL
    )
    entry = {
        "airspeed_true_m_s": TRIM.airspeed_true_m_s, "altitude_m": TRIM.altitude_m, "provenance": "identified",
        "derivatives": {k: {"value": float(v), "standard_error": 0.1} for k, v in stated.items()}, **condition,
    }  # fmt: skip
    return Aircraft.model_validate({"format": 1, "name": "derivatives", "conditions": [entry]})


def with_columns(block: SampleBlock, left_out: tuple[str, ...], still: tuple[str, ...]) -> SampleBlock:
    columns = {name: block.column(name) for name in block.present if name not in left_out}
    return SampleBlock.from_columns({**columns, **{name: np.zeros(len(block)) for name in still}})


@pytest.mark.parametrize("left_out", [(), ("angle_of_attack_rad",)])
def test_an_angle_of_attack_that_the_file_leaves_out_is_the_records(left_out: tuple[str, ...]) -> None:
    flight = with_columns(FLIGHT, left_out, ())
    subject = subject_of(flight, of_derivatives(), {})
    angle, source = steady_angle_rad(subject.flight)
    assert angle == pytest.approx(TRIM.angle_of_attack_rad, abs=0.01)
    assert source == ("median of pitch less climb angle" if left_out else "median of the vane")
    entry = entry_near(subject.aircraft, 25.0)
    assert entry is not None
    assert entry.angle_of_attack_rad == angle
    (found,) = concise(subject.model.row, TRIM, ("y_p",))
    stated = subject.stated.conditions[0].derivatives["y_p"].value
    assert found == pytest.approx(stated, abs=0.01 * TRIM.airspeed_true_m_s), "to what the angle is known"
    zero = subject_of(flight, of_derivatives(angle_of_attack_rad=0.0), {})
    (off,) = concise(zero.model.row, TRIM, ("y_p",))
    assert abs(off - stated) > 1.0, "W of the flight passed for an error of y_p"


def test_an_axis_at_rest_is_held_and_the_other_is_flown() -> None:
    subject = subject_of(with_columns(FLIGHT, (), RESTING), AEROSONDE, {})
    assert subject.followed == (1, 3, 5, 6), "v, p, r, roll"
    assert subject.flight.seconds > 10.0
    none = np.zeros(7)
    problem, point = prepare(subject, Noise(subject.flight.noise_std, none, np.zeros(3)))
    assert np.isfinite(problem.starts).all()
    assert np.isfinite(point.trims[:, [0, 3]]).all(), "lift and pitching moment"
    assert all(np.isfinite(i.follow[:, [1, 3, 5, 6]]).all() for i in problem.inputs)
