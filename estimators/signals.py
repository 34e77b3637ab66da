"""From samples to what one mode's estimators read: states, accelerometer, inputs and the kinematic term.

Both estimators model the aerodynamic part of the specific force and of the angular acceleration. They see the
velocities w = V sin(alpha) and v = V beta, with the angles at the centre of gravity: those that the aerodynamics
feels. Force, gravity and the turning of the axes change them by the equations of ``docs/methods/signals.md``, section
2; near the trim

    dw/dt = a_z + U q - p v + g cos(theta) cos(phi),        dv/dt = a_y - U r + p w + g cos(theta) sin(phi)

(thesis equations 7.1 and 7.3). The part beside the accelerometer's, here called the kinematic term, is known from
measurements, so the aerodynamic derivatives never have the forward speed inside; it is added again when they are
reported (z_q has +U, y_r has -U, y_p has +W).

Column layout of the result (shape (vehicles, samples, columns)): time, states, accelerometer, inputs, then
kinematic term, dynamic pressure ratio rho V^2 / (rho V^2 at the reference), filtered airspeed, air density,
altitude, angle of attack, 1 where the velocity was measured by a vane or 0 where it was reconstructed, for each
rate of the structure (states after the first) the known angular acceleration, rad/s2, and for each input how far the
recorded command is ahead of the measured surface, rad; 0 where either is missing.

The known angular acceleration is inertia coupling (``inertia_coupling``), 0 where the moments of inertia are not
stated or a rate that it needs is missing. It is made of measured rates, so it carries their noise: a product p r
with noises n_p, n_r has the error p n_r + r n_p + n_p n_r, of variance p^2 R_r + r^2 R_p + R_p R_r; a square p^2
has 2 p n_p + n_p^2, of mean R_p, which a trim constant takes. In gentle flight that is far below the noise of a
differentiated rate: at 0.5 rad/s and gyro noise of 0.005 rad/s it is 0.0025 rad/s2, that of a central difference at
50 Hz 0.18 rad/s2.

Without a vane (thesis 7.2) the rates above are integrated. Errors of sensors would then grow without bound, so the
integral leaks: what comes out is not w but w behind a high-pass filter, T s / (T s + 1). ``Signals.high_passed`` lets
the other columns pass the same filter, so that linear equations hold between them as between the originals, but for
their constants. The angle of attack is then that of level flight. What is reconstructed is the aircraft's own
motion: it sees no gust.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wingwatch.aircraft.structures import DUTCH_ROLL, LATERAL, SHORT_PERIOD, ModeStructure
from wingwatch.estimators.inertia_coupling import InertiaCoupling
from wingwatch.estimators.kernels.levels import LEVELS
from wingwatch.estimators.kernels.signals import (
    LAST,
    REST_S,
    ROWS,
    STUCK_S,
    SignalArrays,
    SignalForm,
    fill_moments,
    fill_signals,
    pass_high,
)
from wingwatch.estimators.kernels.vane_lead import VANE_MEMORY, meet_at_centre
from wingwatch.estimators.lanes import Lanes, all_lanes
from wingwatch.telemetry import CHANNEL_INDEX, CHANNELS, INPUT_CHANNELS

__all__ = [
    "CONDITION_COLUMNS",
    "SignalConfig",
    "SignalLayout",
    "Signals",
    "SignalState",
    "known_moments",
    "meets_at_centre",
]

CONDITION_COLUMNS = 7

_RATE_CHANNEL = {"p": "roll_rate_rad_s", "q": "pitch_rate_rad_s", "r": "yaw_rate_rad_s"}


@dataclass(frozen=True, slots=True)
class SignalLayout:
    """Where things stand in a signal row of a structure."""

    states: int
    inputs: int

    @property
    def accelerometer(self) -> int:
        """Column of the accelerometer."""
        return 1 + self.states

    @property
    def first_input(self) -> int:
        """Column of the first control input."""
        return 2 + self.states

    @property
    def kinematic(self) -> int:
        """Column of the kinematic term; the other condition columns follow it."""
        return 2 + self.states + self.inputs

    @property
    def known_moments(self) -> int:
        """First column of the known angular accelerations, one for each state after the first."""
        return self.kinematic + CONDITION_COLUMNS

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.ahead + self.inputs

    @property
    def ahead(self) -> int:
        """First column of how far the command of each input's servo is ahead of its surface, rad; 0 where not known."""
        return self.known_moments + self.states - 1

    def checked(self, signals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals (vehicles, samples, columns) as compiled code reads them, contiguous.

        Raises:
            ValueError: another number of axes or columns, which compiled code would read beyond its end.
        """
        if signals.ndim != 3 or signals.shape[2] != self.columns:
            raise ValueError(
                f"signals have shape {signals.shape}; {self.states} states and {self.inputs} inputs need (vehicles, "
                f"samples, {self.columns}), as Signals gives them"
            )
        return np.ascontiguousarray(signals, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class SignalConfig:
    """How samples become signals of one structure.

    Attributes:
        structure: which mode.
        vane_position_m: (x, y, z) of the vane from the c.g., body axes.
        airspeed_memory_s: time over which is learned how much the airspeed that scales dynamic pressure may be
            smoothed: still air much, rough air little.
        reconstruction_s: leak of the reconstructed velocity where no vane is there (thesis 7.2 integrates
            without leak; sensor biases then drift without bound).
        reference_airspeed_m_s: airspeed to which referred derivatives are scaled.
        reference_density_kg_m3: density likewise.
        servo_s: for each input time constant of the first-order servo that stands between it and the surface, its
            command held to the next; 0 for what is to be taken as it is.
        vane_leads: whether the velocity is given as a vane at the centre of gravity would read it, which meets the air
            later than one ahead of it (``kernels.vane_lead``).
        inertia: moments of inertia, for the known angular accelerations; None where they are not stated.
    """

    structure: ModeStructure
    vane_position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    airspeed_memory_s: float = 10.0
    reconstruction_s: float = 20.0
    reference_airspeed_m_s: float = 25.0
    reference_density_kg_m3: float = 1.225
    servo_s: tuple[float, ...] = ()
    vane_leads: bool = False
    inertia: InertiaCoupling | None = None
    layout: SignalLayout = field(init=False)

    def __post_init__(self) -> None:
        layout = SignalLayout(len(self.structure.states), len(self.structure.inputs))
        object.__setattr__(self, "layout", layout)


@dataclass(slots=True)
class SignalState:
    """Recursive part, one row a vehicle.

    Attributes:
        memory: last time, acceleration along the path, reconstructed velocity, last rate of it, and whether a vane was
            ever seen (a vane that falls silent is not replaced in silence), shape (5,).
        airspeed: smoothers of the airspeed, shape (4, LEVELS).
        passed: last readings of the columns that go with a reconstructed velocity, and what of them has passed its
            filter, shape (2, columns).
        servos: last command of each input, and where its servo has the surface, shape (2, inputs).
        readings: of vane, rates and accelerometer the last reading, how long it has rested while others moved, s, and
            the number of rows in which it was stuck, shape (states + 1, 3).
        vane: what the delay of a vane ahead remembers, shape (VANE_MEMORY,).
    """

    memory: NDArray[np.float64]
    airspeed: NDArray[np.float64]
    passed: NDArray[np.float64]
    servos: NDArray[np.float64]
    readings: NDArray[np.float64]
    vane: NDArray[np.float64]


class Signals:
    """Turns blocks of samples into signals of one structure, for a batch of vehicles.

    A sensor whose reading has not moved for ``STUCK_S`` while another of the structure has is stuck: its readings are
    NaN until it moves again, and estimators pass over such rows. Noise moves every reading, so of healthy sensors
    those of coarse resolution alone are left out, in quiet flight, where they say nothing.

    Attributes:
        sensors: channels of the vane, the rates and the accelerometer, in the order of their columns.
    """

    def __init__(self, config: SignalConfig) -> None:
        self.config = config
        structure = config.structure
        lateral = structure.name in (DUTCH_ROLL.name, LATERAL.name)
        if not lateral and structure.name != SHORT_PERIOD.name:
            raise ValueError(f"no signals are defined for structure {structure.name!r}")
        self.sensors = (
            "sideslip_rad" if lateral else "angle_of_attack_rad",
            *(_RATE_CHANNEL[s] for s in structure.states[1:]),
            "specific_force_y_m_s2" if lateral else "specific_force_z_m_s2",
        )
        self._form = SignalForm(
            lateral=lateral,
            readings=np.array([CHANNEL_INDEX[name] for name in self.sensors]),
            inputs=np.array([CHANNEL_INDEX[INPUT_CHANNELS[u]] for u in structure.inputs]),
            commands=np.array(
                [CHANNEL_INDEX[INPUT_CHANNELS[u].replace("_rad", "_command_rad")] for u in structure.inputs]
            ),
            x_vane_m=config.vane_position_m[0],
            z_vane_m=config.vane_position_m[2],
            airspeed_memory_s=config.airspeed_memory_s,
            reconstruction_s=config.reconstruction_s,
            pressure=config.reference_density_kg_m3 * config.reference_airspeed_m_s**2,
            servo_s=np.array(config.servo_s or (0.0,) * len(structure.inputs)),
        )
        self._coupling = _coupling(config.inertia, structure.states[1:])

    def init(self, vehicles: int) -> SignalState:
        """State before the first sample."""
        memory = np.tile(np.array([np.nan, 0.0, 0.0, 0.0, 0.0]), (vehicles, 1))
        passed = np.full((vehicles, 2, self.config.layout.columns), np.nan)
        servos = np.full((vehicles, 2, self.config.layout.inputs), np.nan)
        readings = np.zeros((vehicles, len(self.sensors), ROWS + 1))
        readings[:, :, LAST] = np.nan
        smoothers = np.zeros((vehicles, 4, LEVELS))
        return SignalState(memory, smoothers, passed, servos, readings, _no_vane(vehicles))

    def update(
        self, state: SignalState, values: NDArray[np.float64], lanes: Lanes | None = None
    ) -> NDArray[np.float64]:
        """Signals of a batch.

        Args:
            state: advanced in place.
            values: shape (vehicles, samples, channels) as in ``SampleBlock.values``.
            lanes: whose rows these are; all vehicles of the state and all rows if not given.

        Returns:
            shape (vehicles, samples, layout.columns), undefined beyond a lane's rows.
        """
        if values.ndim != 3 or values.shape[2] != len(CHANNELS):
            raise ValueError(f"values have shape (vehicles, samples, {len(CHANNELS)}), got {values.shape}")
        layout = self.config.layout
        out = np.empty((*values.shape[:2], layout.columns))
        values, lanes = np.ascontiguousarray(values), lanes or all_lanes(*values.shape[:2])
        arrays = SignalArrays(state.memory, state.airspeed, state.servos, state.readings)
        fill_signals(values, lanes, self._form, arrays, out)
        fill_moments(values, self._coupling, out[..., layout.known_moments : layout.ahead])
        lead_m = self.config.vane_position_m[0]
        if self.config.vane_leads and lead_m > 0.0:
            meet_at_centre(out, lanes, lead_m, layout.accelerometer, layout.kinematic, state.vane)
        return out

    def stuck(self, state: SignalState, vehicle: int = 0) -> tuple[str, ...]:
        """Channels of sensors that are stuck now and are left out."""
        resting = state.readings[vehicle, :, REST_S] > STUCK_S
        return tuple(name for name, still in zip(self.sensors, resting, strict=True) if still)

    def stuck_rows(self, state: SignalState, vehicle: int = 0) -> dict[str, int]:
        """In how many rows each sensor has been stuck, by channel; those that never were are not in it."""
        rows = zip(self.sensors, state.readings[vehicle, :, ROWS].tolist(), strict=True)
        return {name: int(number) for name, number in rows if number}

    def high_passed(
        self, state: SignalState, signals: NDArray[np.float64], lanes: Lanes | None = None
    ) -> NDArray[np.float64]:
        """Signals whose rates, accelerometer, inputs, kinematic term and known moments went the way of a reconstructed
        velocity.

        Args:
            state: advanced in place.
            signals: of ``update``, the next in time.
            lanes: as there.

        Returns:
            the same shape; rows whose velocity a vane measured are as they were.
        """
        out = signals.copy()
        layout = self.config.layout
        passing = np.array([*range(2, layout.kinematic + 1), *range(layout.known_moments, layout.columns)])
        lanes = lanes or all_lanes(*signals.shape[:2])
        pass_high(signals, lanes, state.passed, passing, layout.kinematic, self.config.reconstruction_s, out)
        return out


def meets_at_centre(
    signals: NDArray[np.float64], layout: SignalLayout, vane_ahead_m: float
) -> NDArray[np.float64]:
    """Signal rows of whole records with the velocity that a vane at the centre of gravity would read, as ``Signals``
    gives them with ``vane_leads``.

    Args:
        signals: (vehicles, samples, columns), of a vane ``vane_ahead_m`` ahead.
        layout: of their columns.
    """
    out = signals.copy()
    if vane_ahead_m > 0.0:
        lanes = all_lanes(*out.shape[:2])
        meet_at_centre(out, lanes, vane_ahead_m, layout.accelerometer, layout.kinematic, _no_vane(len(out)))
    return out


def _no_vane(vehicles: int) -> NDArray[np.float64]:
    """What the delay of a vane ahead remembers before the first sample."""
    memory = np.zeros((vehicles, VANE_MEMORY))
    memory[:, :2] = np.nan
    return memory


def known_moments(
    inertia: InertiaCoupling | None, rates: Sequence[str], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Known angular accelerations of samples, as ``Signals`` appends them to its rows.

    Args:
        inertia: None where it is not stated.
        rates: of ``p``, ``q``, ``r``.
        values: (samples, channels) as in ``SampleBlock.values``.

    Returns:
        (samples, rates), rad/s2.
    """
    out = np.empty((1, len(values), len(rates)))
    fill_moments(values[None], _coupling(inertia, rates), out)
    return np.asarray(out[0])


def _coupling(inertia: InertiaCoupling | None, rates: Sequence[str]) -> NDArray[np.float64]:
    if inertia is None:
        return np.zeros((len(rates), 4))
    return np.array([inertia.coefficients(rate) for rate in rates])
