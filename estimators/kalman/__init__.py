"""Kalman filters whose parameters are found from the full likelihood of their innovations."""

from wingwatch.estimators.kalman.filter_error import FilterErrorConfig, filter_error
from wingwatch.estimators.kalman.online import FilterConfig, FilterEstimator, FilterState

__all__ = ["FilterErrorConfig", "filter_error", "FilterConfig", "FilterEstimator", "FilterState"]
