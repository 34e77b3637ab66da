"""Surfaces out of servo outputs, by the parameters each autopilot logs; elevons, V-tails and flaperons taken apart.

Expected angles are worked out from what the aircraft does: positive elevator is nose down, positive aileron rolls left,
positive rudder turns the nose left.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from flown_logs import ardupilot_log, flown, on_the_ground_first, px4_log
from written_logs import Flash, FlashTopic, Ulog, UlogTopic

from wingwatch.telemetry import FlightTable, LogError, load_flight

TRAVEL = {"elevator_rad": 0.4, "aileron_rad": 0.5, "rudder_rad": 0.3}
SURFACES = ("elevator_rad", "aileron_rad", "rudder_rad")


def deflections(flight: FlightTable) -> dict[str, float]:
    """The surfaces' deflections, which are constant in these flights."""
    found = {}
    for name in SURFACES:
        if name in flight.block.present:
            values = flight.block.column(name)
            assert np.ptp(values[np.isfinite(values)]) == 0.0
            found[name] = float(np.nanmedian(values))
    return found


def with_servos(path: Path, parameters: Mapping[str, float], outputs: Sequence[int]) -> FlightTable:
    """An ArduPlane flight whose outputs stand still at the given microseconds."""
    made = ardupilot_log(on_the_ground_first(flown(20.0)))
    stamps = [row[0] for row in next(t for t in made.topics if t.name == "RCOU").rows]
    topics = [t for t in made.topics if t.name != "RCOU"]
    names = ",".join(f"C{i + 1}" for i in range(len(outputs)))
    topics.append(
        FlashTopic("RCOU", "Q" + "H" * len(outputs), f"TimeUS,{names}", [(s, *outputs) for s in stamps])
    )
    path.write_bytes(Flash(topics, parameters).encode())
    return load_flight(path, None, TRAVEL)


def servo(
    number: int, function: int, low: float, trim: float, high: float, turned: int = 0
) -> dict[str, float]:
    values = {"FUNCTION": function, "MIN": low, "TRIM": trim, "MAX": high, "REVERSED": turned}
    return {f"SERVO{number}_{key}": float(value) for key, value in values.items()}


def test_each_side_of_the_trim_has_a_travel_of_its_own_and_a_reversed_servo_turns(tmp_path: Path) -> None:
    parameters = (
        servo(1, 4, 1100, 1520, 1900) | servo(2, 19, 1000, 1450, 1950, 1) | servo(4, 21, 1100, 1500, 1900)
    )
    found = deflections(with_servos(tmp_path / "a.bin", parameters, (1710, 1700, 1000, 1300)))
    # aileron half way to roll right: minus; elevator reversed, half way above trim: nose down, so plus;
    # rudder half way below trim: nose left, so plus
    assert found == pytest.approx({"aileron_rad": -0.25, "elevator_rad": 0.2, "rudder_rad": 0.15})


def test_two_servos_of_one_surface_are_their_mean(tmp_path: Path) -> None:
    parameters = (
        servo(1, 4, 1100, 1500, 1900) | servo(5, 4, 1100, 1500, 1900, 1) | servo(2, 19, 1100, 1500, 1900)
    )
    found = deflections(with_servos(tmp_path / "a.bin", parameters, (1700, 1500, 1000, 1500, 1380)))
    assert found == pytest.approx({"aileron_rad": -0.5 * (0.5 + 0.3) / 2, "elevator_rad": 0.0})


@pytest.mark.parametrize(
    ("functions", "outputs", "expected"),
    [
        # elevons: both up is nose up; right one up alone rolls right and raises the nose half as much
        ((77, 78), (1700, 1700), {"elevator_rad": -0.2, "aileron_rad": 0.0}),
        ((77, 78), (1500, 1700), {"elevator_rad": -0.1, "aileron_rad": -0.125}),
        # V-tail: both up is nose up; left up and right down turns the nose to the right
        ((79, 80), (1300, 1300), {"elevator_rad": 0.2, "rudder_rad": 0.0}),
        ((79, 80), (1700, 1300), {"elevator_rad": 0.0, "rudder_rad": -0.15}),
        # flaperons: what they share is a flap and no aileron
        ((24, 25), (1700, 1700), {"aileron_rad": -0.25}),
        ((24, 25), (1600, 1400), {"aileron_rad": 0.0}),
    ],
)
def test_mixed_surfaces_are_taken_apart(
    tmp_path: Path, functions: tuple[int, int], outputs: tuple[int, int], expected: Mapping[str, float]
) -> None:
    parameters = servo(1, functions[0], 1100, 1500, 1900) | servo(2, functions[1], 1100, 1500, 1900)
    assert deflections(with_servos(tmp_path / "a.bin", parameters, outputs)) == pytest.approx(
        expected, abs=1e-12
    )


def test_logs_before_2017_have_their_servos_under_the_inputs_names(tmp_path: Path) -> None:
    old: dict[str, float] = {}
    for number, (low, trim, high, turn) in enumerate(
        ((1100, 1500, 1900, 1), (1100, 1480, 1900, -1), (1100, 1100, 1900, 1), (1100, 1500, 1900, 1)), 1
    ):
        old |= {
            f"RC{number}_MIN": low,
            f"RC{number}_TRIM": trim,
            f"RC{number}_MAX": high,
            f"RC{number}_REV": turn,
        }
    flight = with_servos(tmp_path / "a.bin", {k: float(v) for k, v in old.items()}, (1500, 1690, 1500, 1700))
    assert deflections(flight) == pytest.approx(
        {"aileron_rad": 0.0, "elevator_rad": 0.2, "rudder_rad": -0.15}
    )
    assert flight.block.column("throttle")[100] == pytest.approx(0.5)


@pytest.mark.parametrize("key", ["ELEVON_OUTPUT", "ELEVON_MIXING", "VTAIL_OUTPUT", "FLAPERON_OUTPUT"])
def test_old_mixing_that_is_not_undone_is_said(tmp_path: Path, key: str) -> None:
    flight = with_servos(tmp_path / "a.bin", {key: 1.0}, (1500, 1500))
    assert not any(name in flight.block.present for name in SURFACES)
    assert any(key in note for note in flight.report.notes)


def test_demands_serve_where_outputs_are_not_logged(tmp_path: Path) -> None:
    made = ardupilot_log(on_the_ground_first(flown(20.0)))
    stamps = [row[0] for row in next(t for t in made.topics if t.name == "RCOU").rows]
    topics = [t for t in made.topics if t.name != "RCOU"]
    topics.append(
        FlashTopic(
            "AETR", "Qffff", "TimeUS,Ail,Elev,Thr,Rudd", [(s, 450.0, 900.0, 50.0, -2250.0) for s in stamps]
        )
    )
    (tmp_path / "a.bin").write_bytes(Flash(topics).encode())
    flight = load_flight(tmp_path / "a.bin", None, TRAVEL)
    assert deflections(flight) == pytest.approx(
        {"aileron_rad": -0.05, "elevator_rad": -0.08, "rudder_rad": 0.15}
    )


def with_controls(
    path: Path, topic: str, control: Sequence[float], parameters: Mapping[str, float]
) -> FlightTable:
    """A PX4 flight whose controls stand still."""
    made = px4_log(on_the_ground_first(flown(20.0)))
    stamps = next(t for t in made.topics if t.name == "actuator_servos").time_us
    topics = [t for t in made.topics if not t.name.startswith("actuator")]
    topics.append(UlogTopic(topic, stamps, [("float", "control", np.tile(control, (len(stamps), 1)))]))
    path.write_bytes(Ulog(topics, {"MAV_TYPE": 1, **parameters}).encode())
    return load_flight(path, None, TRAVEL)


def allocation(*surfaces: tuple[int, float, float, float]) -> dict[str, float]:
    found: dict[str, float] = {"CA_SV_CS_COUNT": len(surfaces)}
    for i, (kind, roll, pitch, yaw) in enumerate(surfaces):
        found |= {f"CA_SV_CS{i}_TYPE": kind}
        found |= {f"CA_SV_CS{i}_TRQ_{axis}": float(t) for axis, t in (("R", roll), ("P", pitch), ("Y", yaw))}
    return found


@pytest.mark.parametrize(
    ("surfaces", "control", "expected"),
    [
        # left aileron down and right up roll to the right; elevator up; rudder to the right
        (
            ((1, -0.5, 0, 0), (2, 0.5, 0, 0), (3, 0, 1, 0), (4, 0, 0, 1)),
            (-0.4, 0.2, 0.5, -0.1),
            {"aileron_rad": -0.15, "elevator_rad": -0.2, "rudder_rad": 0.03},
        ),
        # elevons and V-tails share their angles
        (((5, -0.5, 0.5, 0), (6, 0.5, 0.5, 0)), (0.0, 0.4), {"aileron_rad": -0.1, "elevator_rad": -0.08}),
        (((7, 0, 0.5, 0.5), (8, 0, 0.5, -0.5)), (0.4, -0.4), {"elevator_rad": 0.0, "rudder_rad": -0.12}),
        # flaps between them are none of the three; one servo may turn two ailerons
        (
            ((9, 0, 0, 0), (15, 1, 0, 0), (3, 0, -1, 0)),
            (0.9, 0.2, 0.5),
            {"aileron_rad": -0.1, "elevator_rad": 0.2},
        ),
    ],
)
def test_px4_allocates_by_type_and_torque(
    tmp_path: Path,
    surfaces: Sequence[tuple[int, float, float, float]],
    control: Sequence[float],
    expected: Mapping[str, float],
) -> None:
    eight = (*control, *([np.nan] * (8 - len(control))))
    flight = with_controls(tmp_path / "a.ulg", "actuator_servos", eight, allocation(*surfaces))
    assert deflections(flight) == pytest.approx(expected, abs=1e-7)


def test_px4_before_its_allocation_has_controls(tmp_path: Path) -> None:
    flight = with_controls(tmp_path / "a.ulg", "actuator_controls_0", (0.1, 0.2, -0.3, 0.65, 0, 0, 0, 0), {})
    assert deflections(flight) == pytest.approx(
        {"aileron_rad": -0.05, "elevator_rad": -0.08, "rudder_rad": 0.09}
    )
    assert flight.block.column("throttle")[200] == pytest.approx(0.65)
    assert flight.kinds == dict.fromkeys(SURFACES, "command")


@pytest.mark.parametrize("suffix", ["ulg", "bin"])
def test_without_the_travel_one_sentence_asks_for_it(tmp_path: Path, suffix: str) -> None:
    columns = on_the_ground_first(flown(20.0))
    made = px4_log(columns) if suffix == "ulg" else ardupilot_log(columns)
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(made.encode())
    with pytest.raises(
        LogError, match=r"no log says what angle full travel is: state position_limit_rad under"
    ) as one:
        load_flight(path)
    assert "[actuators.elevator]" in str(one.value)
    only = load_flight(path, None, {"elevator_rad": 0.4})
    assert [name for name in SURFACES if name in only.block.present] == ["elevator_rad"]
    assert any(note.startswith("aileron and rudder left out") for note in only.report.notes)
