"""The Kalman filter whose state holds the derivatives."""

from wingwatch.estimators.ekf.estimator import EkfConfig, EkfEstimator, EkfState

__all__ = ["EkfConfig", "EkfEstimator", "EkfState"]
