"""From scenarios to the arrays that a fleet is flown from: trim, gains, filters and steps, each computed once for all
vehicles that share it."""

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from wingwatch.simulation.autopilot import MEMORY, ORDERS, autopilot_row, hands_off
from wingwatch.simulation.effects import freeze_s
from wingwatch.simulation.flight import Fleet, FleetState, in_body_axes
from wingwatch.simulation.gusts import GUST_COLUMNS, gust_rows
from wingwatch.simulation.layout import CG_X, CG_Z, ELEVATOR_OFFSET, GUST_GAIN, RUDDER_OFFSET, SPAN
from wingwatch.simulation.manoeuvres import EXCITATION_COLUMNS, excitation_rows
from wingwatch.simulation.random_numbers import random_streams
from wingwatch.simulation.rigid_body import DENSITY_ALTITUDE, SETTING_WIDTH, THROTTLE, WIND
from wingwatch.simulation.route import ROUTE_COLUMNS, route_rows
from wingwatch.simulation.scenario import Scenario
from wingwatch.simulation.scenario_timeline import filter_level, timeline_of
from wingwatch.simulation.timeline import Timeline
from wingwatch.simulation.trim import TrimPoint, body_jacobian, trim_row
from wingwatch.simulation.turbulence import STATES, TurbulenceFilter, turbulence_filter
from wingwatch.simulation.wind import WindProfile, wind_at, wind_row

__all__ = ["FRAME_HZ", "flying_start"]

FRAME_HZ = 50.0
"""How often the autopilot gives orders, as near as the sample rate allows."""
STEP_ERROR = 5e-5
"""Error of a Runge-Kutta step relative to what the fastest motion does in its own time constant."""
_GREATEST_PRODUCT = (120.0 * STEP_ERROR) ** 0.25
"""Of eigenvalue and step: the step errs by (lambda dt)^5/120 of the motion, in 1/(lambda dt) steps by the
fourth power."""

_T = TypeVar("_T")


class _Once:
    """Results by their key, so that what vehicles share is computed once."""

    def __init__(self) -> None:
        self._known: dict[Hashable, object] = {}

    def __call__(self, key: Hashable, compute: Callable[[], _T]) -> _T:
        if key not in self._known:
            self._known[key] = compute()
        return self._known[key]  # type: ignore[return-value]


@dataclass(frozen=True, slots=True)
class _Vehicle:
    """What one scenario comes to."""

    line: Timeline
    point: TrimPoint
    gains: NDArray[np.float64]
    steps: int
    air: TurbulenceFilter | None


def steps_a_frame(row: NDArray[np.float64], point: TrimPoint, frame_s: float) -> int:
    """Integration steps that a frame needs, by the fastest of the body's own motions at a trim."""
    fastest = float(np.abs(np.linalg.eigvals(body_jacobian(row, point))).max())
    return int(max(1, math.ceil(fastest * frame_s / _GREATEST_PRODUCT - 1e-9)))


def _prepared(s: Scenario, frame_s: float, samples: int, once: _Once) -> _Vehicle:
    place = (id(s.aircraft), s.airspeed_true_m_s, s.altitude_m, s.ground_altitude_m)
    level = filter_level(s.turbulence, s.effects)
    line = once(("line", place, s.effects, s.turbulence, s.turbulence_model), lambda: timeline_of(s))
    row = line.at(0.0)
    here = (*place, row.tobytes())
    point = once(("trim", here), lambda: trim_row(s.aircraft, s.condition, row))
    steps = once(("steps", place), lambda: _steps(s, line.row, frame_s))
    steps = -(-steps // samples) * samples
    gains = once(("gains", here), lambda: autopilot_row(s.aircraft, s.condition, _commanded(point, row)))
    if s.hands_off:
        gains = hands_off(gains)
    air = None
    if level != "none":
        v, span = s.airspeed_true_m_s, float(line.row[SPAN])
        air = once(
            ("air", level, s.height_m, v, span, s.turbulence_model, steps),
            lambda: turbulence_filter(level, s.height_m, v, span, frame_s / steps, s.turbulence_model),
        )
    return _Vehicle(line, point, gains, steps, air)


def _steps(s: Scenario, clean: NDArray[np.float64], frame_s: float) -> int:
    """By the aircraft without effects, so that an effect changes nothing before it begins."""
    return steps_a_frame(clean, trim_row(s.aircraft, s.condition, clean), frame_s)


def _commanded(point: TrimPoint, row: NDArray[np.float64]) -> TrimPoint:
    """The trim with what has to be commanded for its deflections."""
    elevator, aileron, rudder = point.surfaces_rad - row[ELEVATOR_OFFSET : RUDDER_OFFSET + 1]
    return replace(point, elevator_rad=float(elevator), aileron_rad=float(aileron), rudder_rad=float(rudder))


def flying_start(
    scenarios: Sequence[Scenario], generators: Sequence[np.random.Generator], rate_hz: float, refine: int
) -> tuple[Fleet, FleetState]:
    """Everything a fleet needs to be flown, every vehicle trimmed in the air around it.

    Raises:
        AircraftDataError, TrimError: an aircraft that cannot be simulated, or not be trimmed as asked.
        ValueError: an aircraft that its autopilot cannot fly.
    """
    frames = max(1, round(FRAME_HZ / rate_hz))
    samples = max(1, round(rate_hz / FRAME_HZ))
    frame_s = samples / (rate_hz * frames)
    once = _Once()
    vehicles = [_prepared(s, frame_s, samples, once) for s in scenarios]
    a_frame = np.array([v.steps * refine for v in vehicles], dtype=np.int64)
    fleet = _fleet(scenarios, vehicles, a_frame * frames // samples, a_frame, refine)
    return fleet, _state(scenarios, vehicles, fleet, generators)


def _fleet(
    scenarios: Sequence[Scenario],
    vehicles: Sequence[_Vehicle],
    a_sample: NDArray[np.int64],
    a_frame: NDArray[np.int64],
    refine: int,
) -> Fleet:
    lines = [v.line for v in vehicles]
    excitations = [excitation_rows(s.manoeuvres) for s in scenarios]
    gusts = [gust_rows(s.gusts, s.airspeed_true_m_s) for s in scenarios]
    nothing = next((np.zeros_like(v.air.row) for v in vehicles if v.air is not None), np.zeros(1))
    return Fleet(
        steps_a_sample=a_sample,
        steps_a_frame=a_frame,
        steps_a_gust=refine,
        base=np.array([line.row for line in lines]),
        first_row=_starts([line.times_s.size for line in lines]),
        times=np.concatenate([line.times_s for line in lines]),
        first_column=_starts([line.columns.size for line in lines]),
        columns=np.concatenate([line.columns for line in lines]),
        first_value=_starts([line.values.size for line in lines]),
        values=np.concatenate([line.values.ravel() for line in lines]),
        excitations=_padded(excitations, EXCITATION_COLUMNS),
        excitation_count=np.array([len(rows) for rows in excitations], dtype=np.int64),
        gains=np.array([v.gains for v in vehicles]),
        route=_padded([route_rows(s.route) for s in scenarios], ROUTE_COLUMNS),
        wind=np.array(
            [wind_row(s.wind_profile, s.wind_m_s, s.altitude_m, s.ground_altitude_m) for s in scenarios]
        ),
        sheared=np.array([s.wind_profile != WindProfile() for s in scenarios]),
        turbulent=np.array([v.air is not None for v in vehicles]),
        gust_filter=np.array([nothing if v.air is None else v.air.row for v in vehicles]),
        gusts=_padded(gusts, GUST_COLUMNS),
        gust_count=np.array([len(rows) for rows in gusts], dtype=np.int64),
        airspeed_freeze_s=np.array([freeze_s(s.effects, "airspeed_true_m_s") for s in scenarios]),
    )


def _padded(tables: Sequence[NDArray[np.float64]], columns: int) -> NDArray[np.float64]:
    """Tables of different length as one array, zeros below the shorter ones."""
    out = np.zeros((len(tables), max(len(t) for t in tables), columns))
    for i, table in enumerate(tables):
        out[i, : len(table)] = table
    return out


def _starts(lengths: Sequence[int]) -> NDArray[np.int64]:
    """Where each of several tables starts that stand one after another, and the end."""
    return np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)


def _state(
    scenarios: Sequence[Scenario],
    vehicles: Sequence[_Vehicle],
    fleet: Fleet,
    generators: Sequence[np.random.Generator],
) -> FleetState:
    """Trimmed in the air that each vehicle is in: it moves with the wind and with the gust of the first instant."""
    n = len(vehicles)
    surfaces = np.array([v.point.surfaces_rad for v in vehicles])
    rows = np.array([v.line.at(0.0) for v in vehicles])
    state = FleetState(
        rigid=np.array([v.point.state for v in vehicles]),
        setting=np.zeros((n, SETTING_WIDTH)),
        servos=surfaces.copy(),
        surfaces=surfaces,
        orders=np.zeros((n, ORDERS)),
        memory=np.zeros((n, MEMORY)),
        gust_filter=np.zeros((n, STATES)),
        gust=np.zeros((n, 6)),
        streams=random_streams(generators),
        centre=rows[:, CG_X : CG_Z + 1].copy(),
        airspeed_read=np.zeros(n),
    )
    state.setting[:, DENSITY_ALTITUDE] = math.inf
    for i, (s, v, generator) in enumerate(zip(scenarios, vehicles, generators, strict=True)):
        if v.air is not None:
            state.gust_filter[i] = v.air.stationary @ generator.standard_normal(STATES)
            state.gust[i] = rows[i, GUST_GAIN] * (v.air.output @ state.gust_filter[i])
            in_body_axes(state.rigid[i], state.gust[i])
        wind = np.zeros(3)
        wind_at(fleet.wind[i], s.altitude_m, wind)
        state.setting[i, WIND : WIND + 3] = wind
        state.setting[i, THROTTLE] = v.point.throttle
        state.rigid[i, 3:6] += _to_body(state.rigid[i], wind) + state.gust[i, :3]
    return state


def _to_body(state: NDArray[np.float64], wind: NDArray[np.float64]) -> NDArray[np.float64]:
    """A vector in earth axes in body axes: v + 2 q0 (v x q) + 2 (v x q) x q of the quaternion's conjugate."""
    across = np.cross(wind, state[7:10])
    return np.asarray(wind + 2.0 * state[6] * across + 2.0 * np.cross(across, state[7:10]))
