"""Recursive Fourier least squares."""

from wingwatch.estimators.fourier.estimator import FourierConfig, FourierEstimator, FourierState

__all__ = ["FourierConfig", "FourierEstimator", "FourierState"]
