"""The aircraft file: what wingwatch must know about one type of aircraft (contract "aircraft file").

Everything but the name is optional; what a calculation needs and the file does not say is refused in one
sentence by that calculation (``AircraftDataError``).
"""

import math
from enum import StrEnum
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from wingwatch.aircraft.coefficients import Coefficients
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.structures import MODEL_STRUCTURES, ModeStructure
from wingwatch.aircraft.vocabulary import MODEL_DERIVATIVES

__all__ = [
    "Actuator",
    "Actuators",
    "Aircraft",
    "AircraftDataError",
    "ConditionEntry",
    "ConstantThrust",
    "DerivativeEntry",
    "ElectricPropulsion",
    "EnvelopeLimits",
    "Geometry",
    "Mass",
    "Mode",
    "Provenance",
    "SENSOR_COLUMNS",
    "SecondOrderLag",
    "Sensors",
]

_T = TypeVar("_T")

SENSOR_COLUMNS: tuple[str, ...] = (
    "airspeed_true_m_s",
    "airspeed_indicated_m_s",
    "roll_rate_rad_s",
    "pitch_rate_rad_s",
    "yaw_rate_rad_s",
    "specific_force_x_m_s2",
    "specific_force_y_m_s2",
    "specific_force_z_m_s2",
    "roll_rad",
    "pitch_rad",
    "heading_rad",
    "elevator_rad",
    "aileron_rad",
    "rudder_rad",
    "angle_of_attack_rad",
    "sideslip_rad",
    "throttle",
    "altitude_m",
    "air_density_kg_m3",
    "outside_air_temperature_k",
    "elevator_command_rad",
    "aileron_command_rad",
    "rudder_command_rad",
    "aileron_left_rad",
    "aileron_right_rad",
    "velocity_north_m_s",
    "velocity_east_m_s",
    "velocity_down_m_s",
    "latitude_deg",
    "longitude_deg",
)
"""Flight-table columns that a sensor or actuator signal can have noise or delay in."""


class AircraftDataError(ValueError):
    """A calculation needs something that the aircraft's file does not say; the sentence names both."""


class Provenance(StrEnum):
    """What an expectation rests on, weakest first."""

    A_PRIORI = "a-priori"
    EMPIRICAL = "empirical"
    IDENTIFIED = "identified"


def _sensor_columns(table: dict[str, _T]) -> dict[str, _T]:
    for key in table:
        if key not in SENSOR_COLUMNS:
            raise ValueError(f"{key!r} is no sensor column; allowed are {', '.join(SENSOR_COLUMNS)}")
    return table


def _structures(table: dict[str, "Mode"]) -> dict[str, "Mode"]:
    for key in table:
        if key not in MODEL_STRUCTURES:
            raise ValueError(f"{key!r} is no mode; allowed are {', '.join(MODEL_STRUCTURES)}")
    return table


def _derivatives(table: dict[str, "DerivativeEntry"]) -> dict[str, "DerivativeEntry"]:
    for key in table:
        if key not in MODEL_DERIVATIVES:
            raise ValueError(f"{key!r} is no derivative; allowed are {', '.join(MODEL_DERIVATIVES)}")
    return table


def _ascending(pair: tuple[float, float]) -> tuple[float, float]:
    if not pair[0] < pair[1]:
        raise ValueError(f"the limits {list(pair)} do not ascend; give [lowest, highest]")
    return pair


Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Vector = tuple[float, float, float]
SensorTable = Annotated[dict[str, Annotated[float, Field(ge=0.0)]], AfterValidator(_sensor_columns)]
DelayTable = Annotated[dict[str, Annotated[float, Field(ge=0.0, le=10.0)]], AfterValidator(_sensor_columns)]
PositiveSensorTable = Annotated[dict[str, Positive], AfterValidator(_sensor_columns)]
PositiveLimits = Annotated[tuple[Positive, Positive], AfterValidator(_ascending)]
Limits = Annotated[tuple[float, float], AfterValidator(_ascending)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Geometry(_Table):
    """Reference dimensions; the tail's for empirical prediction (thesis tables B.1 and B.2), all optional."""

    wing_area_m2: Positive
    span_m: Positive
    mean_chord_m: Positive
    tail_area_m2: Positive | None = None
    tail_arm_m: Positive | None = None
    fin_area_m2: Positive | None = None
    fin_arm_m: Positive | None = None


class Mass(_Table):
    """Mass and moments of inertia about the centre of gravity in body axes.

    ``cg_shift_m`` says how far aft of the point that the moments of [coefficients] are about the centre of gravity
    lies; all else in the file is from the centre of gravity itself.
    """

    mass_kg: Positive
    inertia_x_kg_m2: Positive
    inertia_y_kg_m2: Positive
    inertia_z_kg_m2: Positive
    inertia_xz_kg_m2: float = 0.0
    cg_shift_m: float = 0.0

    @model_validator(mode="after")
    def _realisable(self) -> "Mass":
        if self.inertia_xz_kg_m2**2 >= self.inertia_x_kg_m2 * self.inertia_z_kg_m2:
            raise ValueError(
                f"inertia_xz_kg_m2 is {self.inertia_xz_kg_m2}; no body has its square at or above "
                f"inertia_x_kg_m2 times inertia_z_kg_m2 = {self.inertia_x_kg_m2 * self.inertia_z_kg_m2:.6g}"
            )
        return self


class SecondOrderLag(_Table):
    """A sensor or filter that follows with x'' + 2 D w x' + w^2 x = w^2 input."""

    natural_frequency_hz: Positive
    damping_ratio: Positive


class Sensors(_Table):
    """Where sensors sit from the centre of gravity (body axes), and how each column follows the truth.

    A column is low-pass filtered (``lag_s``, ``second_order``), late by ``delay_s``, noisy, rounded to ``resolution``
    and renewed ``rate_hz`` times a second; what a table does not name is not so.
    """

    imu_position_m: Vector = (0.0, 0.0, 0.0)
    vane_position_m: Vector = (0.0, 0.0, 0.0)
    noise_std: SensorTable = Field(default_factory=dict)
    delay_s: DelayTable = Field(default_factory=dict)
    lag_s: SensorTable = Field(default_factory=dict)
    second_order: Annotated[dict[str, SecondOrderLag], AfterValidator(_sensor_columns)] = Field(
        default_factory=dict
    )
    resolution: SensorTable = Field(default_factory=dict)
    rate_hz: PositiveSensorTable = Field(default_factory=dict)


class Actuator(_Table):
    """A first-order surface actuator; a limit that is absent does not act. Position limits are symmetric.

    ``backlash_rad`` is the full width of the play between servo and surface, ``dead_band_rad`` the full width
    of command errors that the servo does not answer.
    """

    bandwidth_hz: Positive
    rate_limit_rad_s: Positive | None = None
    position_limit_rad: Positive | None = None
    backlash_rad: NotNegative = 0.0
    dead_band_rad: NotNegative = 0.0


class Actuators(_Table):
    """The three surfaces; an absent one is taken as ideal."""

    elevator: Actuator | None = None
    aileron: Actuator | None = None
    rudder: Actuator | None = None


class Mode(_Table):
    """Analysis band of one mode."""

    band_hz: PositiveLimits


class EnvelopeLimits(_Table):
    """Where the file's expectations may be used, and the point it is usually flown at."""

    airspeed_true_m_s: PositiveLimits
    altitude_m: Limits
    cruise_airspeed_true_m_s: Positive | None = None
    cruise_altitude_m: float | None = None

    @model_validator(mode="after")
    def _cruise_inside(self) -> "EnvelopeLimits":
        for key, value, (low, high) in (
            ("cruise_airspeed_true_m_s", self.cruise_airspeed_true_m_s, self.airspeed_true_m_s),
            ("cruise_altitude_m", self.cruise_altitude_m, self.altitude_m),
        ):
            if value is not None and not low <= value <= high:
                raise ValueError(f"{key} is {value}; give a value in the envelope's {low:g} to {high:g}")
        return self

    @property
    def cruise(self) -> FlightCondition:
        """The stated cruise point, else the middle of the limits."""
        airspeed, altitude = self.cruise_airspeed_true_m_s, self.cruise_altitude_m
        return FlightCondition(
            math.fsum(self.airspeed_true_m_s) / 2.0 if airspeed is None else airspeed,
            math.fsum(self.altitude_m) / 2.0 if altitude is None else altitude,
        )


class _Propulsion(_Table):
    """Thrust along x body, ``thrust_line_z_m`` below the centre of gravity; ``slipstream_share`` of the tail lies in
    the propeller's slipstream (0: none, and then the coefficients are those with the propeller running)."""

    thrust_line_z_m: float = 0.0
    slipstream_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class ConstantThrust(_Propulsion):
    """Throttle times a constant, whatever the airspeed; with a slipstream, from a propeller of a diameter."""

    kind: Literal["constant_thrust"]
    thrust_max_n: Positive
    propeller_diameter_m: Positive | None = None

    @model_validator(mode="after")
    def _slipstream_needs_a_disk(self) -> "ConstantThrust":
        if self.slipstream_share > 0.0 and self.propeller_diameter_m is None:
            raise ValueError(
                f"slipstream_share is {self.slipstream_share} without a propeller_diameter_m; state the diameter"
            )
        return self


class ElectricPropulsion(_Propulsion):
    """A fixed-pitch propeller on a direct-current motor (Beard and McLain, Small Unmanned Aircraft, ch. 4).

    ``thrust_coefficients`` and ``torque_coefficients`` are (c0, c1, c2) of c0 + c1 J + c2 J^2, J = V / (n D),
    T = ρ n^2 D^4 C_T, Q = ρ n^2 D^5 C_Q, n in revolutions per second.
    """

    kind: Literal["electric_propeller"]
    propeller_diameter_m: Positive
    thrust_coefficients: Vector
    torque_coefficients: Vector
    motor_constant_v_s_rad: Positive
    torque_constant_n_m_a: Positive
    resistance_ohm: Positive
    no_load_current_a: Annotated[float, Field(ge=0.0)]
    voltage_max_v: Positive


class DerivativeEntry(_Table):
    """A concise derivative that is stated outright."""

    value: float
    standard_error: Positive


class ConditionEntry(_Table):
    """Concise derivatives stated at one point of the envelope, and what they rest on."""

    airspeed_true_m_s: Positive
    altitude_m: float
    air_density_kg_m3: Positive | None = None
    angle_of_attack_rad: float = 0.0
    configuration: str = "clean"
    provenance: Provenance
    source: str = ""
    derivatives: Annotated[dict[str, DerivativeEntry], AfterValidator(_derivatives)]

    @property
    def condition(self) -> FlightCondition:
        """The point as a flight condition."""
        density = math.nan if self.air_density_kg_m3 is None else self.air_density_kg_m3
        return FlightCondition(
            self.airspeed_true_m_s, self.altitude_m, density, self.configuration, self.angle_of_attack_rad
        )

    def covers(self, structure: ModeStructure) -> bool:
        """Whether every derivative of a structure is stated here."""
        return all(symbol in self.derivatives for symbol in structure.derivatives)


class Aircraft(_Table):
    """One type of aircraft, as its file describes it."""

    format: Literal[1]
    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")]
    description: str = ""
    geometry: Geometry | None = None
    mass: Mass | None = None
    sensors: Sensors = Field(default_factory=Sensors)
    actuators: Actuators = Field(default_factory=Actuators)
    modes: Annotated[dict[str, Mode], AfterValidator(_structures)] = Field(default_factory=dict)
    envelope: EnvelopeLimits | None = None
    coefficients: Coefficients | None = None
    propulsion: Annotated[ElectricPropulsion | ConstantThrust, Field(discriminator="kind")] | None = None
    conditions: tuple[ConditionEntry, ...] = ()

    def noise_std(self, column: str) -> float | None:
        """Noise standard deviation of a flight-table column in its unit, None where the file says none."""
        return self.sensors.noise_std.get(column)

    def delay_s(self, column: str) -> float:
        """Delay of a flight-table column in s, 0 where the file says none."""
        return self.sensors.delay_s.get(column, 0.0)

    def entries(self, structure: ModeStructure, configuration: str = "clean") -> tuple[ConditionEntry, ...]:
        """The stated conditions that have all of a structure's derivatives in a configuration."""
        return tuple(c for c in self.conditions if c.configuration == configuration and c.covers(structure))

    @property
    def nominal_condition(self) -> FlightCondition | None:
        """The condition that derivatives are referred to: its cruise, else its first stated condition."""
        if self.envelope is not None:
            return self.envelope.cruise
        return self.conditions[0].condition if self.conditions else None

    @property
    def cg_shift_m(self) -> float:
        """How far aft of the coefficients' own point the centre of gravity lies, m."""
        return 0.0 if self.mass is None else self.mass.cg_shift_m

    def need_geometry(self, purpose: str) -> Geometry:
        """The geometry, or AircraftDataError saying what for."""
        if self.geometry is None:
            raise AircraftDataError(self._absent("geometry", purpose))
        return self.geometry

    def need_mass(self, purpose: str) -> Mass:
        """The mass, or AircraftDataError saying what for."""
        if self.mass is None:
            raise AircraftDataError(self._absent("mass", purpose))
        return self.mass

    def need_coefficients(self, purpose: str) -> Coefficients:
        """The coefficients, or AircraftDataError saying what for."""
        if self.coefficients is None:
            raise AircraftDataError(self._absent("coefficients", purpose))
        return self.coefficients

    def _absent(self, table: str, purpose: str) -> str:
        return f"aircraft {self.name} states no [{table}], which {purpose} needs; add that table to its file"
