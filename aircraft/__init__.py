"""The words: derivatives, mode structures, flight condition, conventions, aircraft files and the library.

Example:
    What an aircraft file makes expect at a flight condition, in two conventions:

    >>> from wingwatch.aircraft import SHORT_PERIOD, Convention, FlightCondition, convert
    >>> from wingwatch.aircraft import linearised_derivatives, load_aircraft, trimmed
    >>> aerosonde = load_aircraft("aerosonde")
    >>> cruise = trimmed(aerosonde, FlightCondition(25.0, 1000.0))
    >>> concise = linearised_derivatives(aerosonde, cruise, SHORT_PERIOD)
    >>> american = convert(
    ...     concise, aircraft=aerosonde, condition=cruise, structure=SHORT_PERIOD,
    ...     source=Convention.CONCISE, target=Convention.AMERICAN,
    ... )
    >>> round(concise["m_q"], 2), round(american["m_q"], 1)
    (-4.64, -38.2)
"""

from wingwatch.aircraft.aerodynamics import (
    BodyCoefficients,
    aspect_ratio,
    body_coefficients,
    drag_coefficient,
    lift_coefficient,
)
from wingwatch.aircraft.aircraft_file import (
    SENSOR_COLUMNS,
    Actuator,
    Actuators,
    Aircraft,
    AircraftDataError,
    ConditionEntry,
    ConstantThrust,
    DerivativeEntry,
    ElectricPropulsion,
    EnvelopeLimits,
    Geometry,
    Mass,
    Mode,
    Provenance,
    Sensors,
)
from wingwatch.aircraft.atmosphere import (
    GRAVITY_M_S2,
    SEA_LEVEL_DENSITY_KG_M3,
    air_density_kg_m3,
    isa_density_kg_m3,
    isa_pressure_pa,
    isa_temperature_k,
    true_from_indicated,
)
from wingwatch.aircraft.avl_file import AvlError, read_avl_mass, read_avl_run
from wingwatch.aircraft.avl_reading import avl_coefficients
from wingwatch.aircraft.coefficients import (
    Coefficients,
    DirectionalCoefficients,
    DragCoefficients,
    LiftCoefficients,
    PitchCoefficients,
    StallBlend,
    coefficient_names,
)
from wingwatch.aircraft.condition import FlightCondition
from wingwatch.aircraft.conventions import (
    Affine,
    AffineForm,
    Convention,
    affine,
    convert,
    convert_standard_errors,
    display_name,
    longitudinal_mass_matrix,
    unit,
    unsteady_inertia,
)
from wingwatch.aircraft.excitation import (
    deal_harmonics,
    doublet_pulse_s,
    relative_peak_factor,
    schroeder_phases_rad,
    step_3211_s,
    wave,
)
from wingwatch.aircraft.icing import (
    ICING_FACTORS,
    ICING_SEVERITY_MAX,
    IcingKind,
    icing_direction,
    icing_factor,
)
from wingwatch.aircraft.jsbsim_model import JsbsimError
from wingwatch.aircraft.jsbsim_reading import jsbsim_aircraft
from wingwatch.aircraft.jsbsim_writing import jsbsim_xml
from wingwatch.aircraft.linearisation import (
    Trim,
    TrimError,
    derived_from,
    linearised_at,
    linearised_derivatives,
    reduced,
    trim,
    trimmed,
)
from wingwatch.aircraft.loading import AircraftFileError, library_names, load_aircraft, parse_aircraft
from wingwatch.aircraft.making import Dimensions, aircraft_like, empirical_aircraft, known_aircraft
from wingwatch.aircraft.mass_and_balance import american_map, at_loading, carried
from wingwatch.aircraft.modes import (
    ModeQuantity,
    analysis_band_hz,
    mode_quantities,
    natural_frequency_and_damping,
    state_matrix,
)
from wingwatch.aircraft.plausible_file import FileCheck, check_file
from wingwatch.aircraft.plausible_finding import FileFinding
from wingwatch.aircraft.saving import aircraft_toml
from wingwatch.aircraft.state_space import KnownTerms, change_form, form_scale, known_terms, state_space
from wingwatch.aircraft.structures import (
    DUTCH_ROLL,
    DUTCH_ROLL_BETA,
    LATERAL,
    LATERAL_FULL,
    LONGITUDINAL,
    LONGITUDINAL_THROTTLE,
    MODEL_STRUCTURES,
    PHUGOID,
    ROLL,
    SHORT_PERIOD,
    SHORT_PERIOD_ALPHA,
    SPIRAL,
    STRUCTURES,
    ModeStructure,
)
from wingwatch.aircraft.tangent import with_stated_derivatives
from wingwatch.aircraft.thrust import ThrustSlopes, propulsion_thrust_n, thrust_slopes
from wingwatch.aircraft.uncertainty import (
    coefficient_standard_error,
    derivative_covariance,
    derivative_standard_errors,
)
from wingwatch.aircraft.vocabulary import (
    DERIVATIVES,
    MODEL_DERIVATIVES,
    SURFACE_OF_INPUT,
    SURFACES,
    Derivative,
)

__all__ = [
    "Derivative",
    "DERIVATIVES",
    "MODEL_DERIVATIVES",
    "SURFACES",
    "SURFACE_OF_INPUT",
    "ModeStructure",
    "SHORT_PERIOD",
    "SHORT_PERIOD_ALPHA",
    "PHUGOID",
    "LONGITUDINAL",
    "LONGITUDINAL_THROTTLE",
    "DUTCH_ROLL",
    "DUTCH_ROLL_BETA",
    "ROLL",
    "SPIRAL",
    "LATERAL",
    "LATERAL_FULL",
    "STRUCTURES",
    "MODEL_STRUCTURES",
    "KnownTerms",
    "known_terms",
    "state_space",
    "change_form",
    "form_scale",
    "ThrustSlopes",
    "propulsion_thrust_n",
    "thrust_slopes",
    "FlightCondition",
    "GRAVITY_M_S2",
    "SEA_LEVEL_DENSITY_KG_M3",
    "isa_temperature_k",
    "isa_pressure_pa",
    "isa_density_kg_m3",
    "air_density_kg_m3",
    "true_from_indicated",
    "Aircraft",
    "Geometry",
    "Mass",
    "Sensors",
    "SENSOR_COLUMNS",
    "Actuator",
    "Actuators",
    "Mode",
    "EnvelopeLimits",
    "ConstantThrust",
    "ElectricPropulsion",
    "Provenance",
    "ConditionEntry",
    "DerivativeEntry",
    "AircraftDataError",
    "AircraftFileError",
    "load_aircraft",
    "aircraft_toml",
    "parse_aircraft",
    "library_names",
    "Coefficients",
    "LiftCoefficients",
    "DragCoefficients",
    "DirectionalCoefficients",
    "PitchCoefficients",
    "StallBlend",
    "coefficient_names",
    "BodyCoefficients",
    "aspect_ratio",
    "body_coefficients",
    "lift_coefficient",
    "drag_coefficient",
    "Convention",
    "Affine",
    "AffineForm",
    "affine",
    "convert",
    "convert_standard_errors",
    "display_name",
    "unit",
    "unsteady_inertia",
    "longitudinal_mass_matrix",
    "Trim",
    "TrimError",
    "trim",
    "trimmed",
    "linearised_derivatives",
    "linearised_at",
    "at_loading",
    "carried",
    "american_map",
    "derived_from",
    "reduced",
    "coefficient_standard_error",
    "derivative_covariance",
    "derivative_standard_errors",
    "ModeQuantity",
    "mode_quantities",
    "natural_frequency_and_damping",
    "state_matrix",
    "analysis_band_hz",
    "JsbsimError",
    "jsbsim_aircraft",
    "jsbsim_xml",
    "with_stated_derivatives",
    "AvlError",
    "read_avl_run",
    "read_avl_mass",
    "avl_coefficients",
    "known_aircraft",
    "Dimensions",
    "aircraft_like",
    "empirical_aircraft",
    "FileCheck",
    "FileFinding",
    "check_file",
    "ICING_FACTORS",
    "ICING_SEVERITY_MAX",
    "IcingKind",
    "icing_factor",
    "icing_direction",
    "deal_harmonics",
    "doublet_pulse_s",
    "relative_peak_factor",
    "schroeder_phases_rad",
    "step_3211_s",
    "wave",
]
