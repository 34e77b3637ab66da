"""Estimators: derivatives with covariance and standing, online, for batches of vehicles."""

from wingwatch.estimators.ekf import EkfConfig, EkfEstimator, EkfState
from wingwatch.estimators.estimate import BlockEvidence, Estimate, Outcome
from wingwatch.estimators.fourier import FourierConfig, FourierEstimator, FourierState
from wingwatch.estimators.reference import offsets, referred_scale
from wingwatch.estimators.signals import SignalConfig, SignalLayout, Signals, SignalState

__all__ = [
    "Estimate",
    "Outcome",
    "BlockEvidence",
    "FourierConfig",
    "FourierEstimator",
    "FourierState",
    "EkfConfig",
    "EkfEstimator",
    "EkfState",
    "SignalConfig",
    "SignalLayout",
    "SignalState",
    "Signals",
    "offsets",
    "referred_scale",
]
