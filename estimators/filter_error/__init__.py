"""Kalman filters whose parameters are found from the full likelihood of their innovations."""

from wingwatch.estimators.filter_error.whole_flight import FilterErrorConfig, filter_error

__all__ = ["FilterErrorConfig", "filter_error"]
