"""Kalman filters whose parameters are found from the full likelihood of their innovations."""
