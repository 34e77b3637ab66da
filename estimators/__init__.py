"""Estimators: derivatives with covariance and validity, online, for batches of vehicles.

Example:
    The derivatives of a linear flight without noise come back from its samples:

    >>> import numpy as np
    >>> from wingwatch.aircraft import SHORT_PERIOD, FlightCondition, linearised_derivatives, load_aircraft, trimmed
    >>> from wingwatch.estimators import FlightForm, equation_error, flight_manoeuvres
    >>> from wingwatch.simulation import linear_flight
    >>> aerosonde = load_aircraft("aerosonde")
    >>> cruise = trimmed(aerosonde, FlightCondition(25.0, 1000.0))
    >>> true = linearised_derivatives(aerosonde, cruise, SHORT_PERIOD)
    >>> elevator_rad = 0.03 * np.sign(np.sin(2.0 * np.arange(600) / 50.0))
    >>> flight = linear_flight(SHORT_PERIOD, true, cruise, elevator_rad, 50.0)
    >>> form = FlightForm((25.0, cruise.air_density_kg_m3))
    >>> estimate, fit = equation_error(flight_manoeuvres(SHORT_PERIOD, form, [flight]))
    >>> bool(np.allclose(estimate.value, list(true.values()), rtol=0.01))
    True
    >>> str(estimate.outcome)
    'converged'
"""

from wingwatch.estimators.confounding import confounding_text
from wingwatch.estimators.ekf.estimator import EkfConfig, EkfEstimator, EkfState
from wingwatch.estimators.ekf.state import arrays_of, one_vehicle
from wingwatch.estimators.estimate import BlockEvidence, Estimate, Outcome
from wingwatch.estimators.fourier.estimator import FourierConfig, FourierEstimator, FourierState
from wingwatch.estimators.inertia_coupling import InertiaCoupling, inertia_coupling
from wingwatch.estimators.lanes import Lanes, padded
from wingwatch.estimators.offline.equation_error import EquationErrorConfig, equation_error
from wingwatch.estimators.offline.filter_error import FilterErrorConfig, filter_error
from wingwatch.estimators.offline.fit import ChannelFit, Fit, channel_fit, correlated_pairs
from wingwatch.estimators.offline.flight_manoeuvres import (
    FORMS,
    FlightForm,
    Form,
    flight_manoeuvres,
    in_form,
    missing_channels,
    solved_as,
)
from wingwatch.estimators.offline.frequency_equation_error import (
    FrequencyEquationErrorConfig,
    frequency_equation_error,
)
from wingwatch.estimators.offline.manoeuvre import Manoeuvre, ManoeuvreConfig, manoeuvres
from wingwatch.estimators.offline.output_error import OutputErrorConfig, output_error
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.signals import SignalConfig, SignalLayout, Signals, SignalState, meets_at_centre
from wingwatch.estimators.standing import Validities, Validity

__all__ = [
    "Estimate",
    "confounding_text",
    "Outcome",
    "BlockEvidence",
    "FourierConfig",
    "FourierEstimator",
    "FourierState",
    "EkfConfig",
    "EkfEstimator",
    "EkfState",
    "Validities",
    "Validity",
    "Lanes",
    "arrays_of",
    "one_vehicle",
    "padded",
    "InertiaCoupling",
    "inertia_coupling",
    "SignalConfig",
    "SignalLayout",
    "SignalState",
    "Signals",
    "offsets",
    "referred_scale",
    "Manoeuvre",
    "ManoeuvreConfig",
    "manoeuvres",
    "meets_at_centre",
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
    "FilterErrorConfig",
    "filter_error",
    "Fit",
    "ChannelFit",
    "channel_fit",
    "correlated_pairs",
]
