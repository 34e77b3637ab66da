"""Estimators: derivatives with covariance and standing, online, for batches of vehicles."""

from wingwatch.estimators.confounding import told_apart_text
from wingwatch.estimators.differentiation import (
    differentiate_local,
    differentiate_spline,
    differentiate_wiener,
)
from wingwatch.estimators.ekf import EkfConfig, EkfEstimator, EkfState
from wingwatch.estimators.equation_error import EquationErrorConfig, equation_error
from wingwatch.estimators.estimate import BlockEvidence, Estimate, Outcome
from wingwatch.estimators.excitation import (
    INPUT_KINDS,
    InputDesign,
    SurfaceTarget,
    design_input,
    surface_targets,
)
from wingwatch.estimators.excitation_limits import input_notes
from wingwatch.estimators.excitation_promise import (
    ModeResponse,
    Promise,
    SensedPlant,
    promise,
    sensed_plant,
)
from wingwatch.estimators.fit import ChannelFit, Fit, channel_fit, correlated_pairs
from wingwatch.estimators.flight_manoeuvres import (
    FORMS,
    FlightForm,
    Form,
    flight_manoeuvres,
    in_form,
    missing_channels,
    solved_as,
)
from wingwatch.estimators.fourier import FourierConfig, FourierEstimator, FourierState
from wingwatch.estimators.frequency_equation_error import (
    FrequencyEquationErrorConfig,
    frequency_equation_error,
)
from wingwatch.estimators.inertia_coupling import InertiaCoupling, inertia_coupling
from wingwatch.estimators.kalman import (
    FilterConfig,
    FilterErrorConfig,
    FilterEstimator,
    FilterState,
    filter_error,
)
from wingwatch.estimators.manoeuvre import Manoeuvre, ManoeuvreConfig, concatenated, manoeuvres
from wingwatch.estimators.output_error import OutputErrorConfig, output_error
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.rough_air import ROUGH_SHARE, gather_motion
from wingwatch.estimators.roughness import ROUGHNESS, follow_roughness, is_gusty
from wingwatch.estimators.signals import SignalConfig, SignalLayout, Signals, SignalState
from wingwatch.estimators.smoothing import Smoothed, smooth_local, smooth_spline, smooth_wiener
from wingwatch.estimators.static_derivatives import (
    StaticDerivatives,
    neutral_point,
    static_derivatives,
    static_margin,
)

__all__ = [
    "Estimate",
    "told_apart_text",
    "Outcome",
    "BlockEvidence",
    "FourierConfig",
    "FourierEstimator",
    "FourierState",
    "EkfConfig",
    "EkfEstimator",
    "EkfState",
    "InertiaCoupling",
    "inertia_coupling",
    "SignalConfig",
    "SignalLayout",
    "SignalState",
    "Signals",
    "ROUGH_SHARE",
    "gather_motion",
    "ROUGHNESS",
    "follow_roughness",
    "is_gusty",
    "offsets",
    "referred_scale",
    "Manoeuvre",
    "ManoeuvreConfig",
    "manoeuvres",
    "concatenated",
    "FORMS",
    "Form",
    "FlightForm",
    "flight_manoeuvres",
    "missing_channels",
    "solved_as",
    "in_form",
    "EquationErrorConfig",
    "equation_error",
    "FrequencyEquationErrorConfig",
    "frequency_equation_error",
    "OutputErrorConfig",
    "output_error",
    "FilterConfig",
    "FilterEstimator",
    "FilterState",
    "FilterErrorConfig",
    "filter_error",
    "Fit",
    "ChannelFit",
    "channel_fit",
    "correlated_pairs",
    "Smoothed",
    "smooth_local",
    "smooth_wiener",
    "smooth_spline",
    "differentiate_local",
    "differentiate_wiener",
    "differentiate_spline",
    "INPUT_KINDS",
    "InputDesign",
    "SurfaceTarget",
    "design_input",
    "surface_targets",
    "SensedPlant",
    "sensed_plant",
    "Promise",
    "ModeResponse",
    "promise",
    "input_notes",
    "StaticDerivatives",
    "static_derivatives",
    "static_margin",
    "neutral_point",
]
