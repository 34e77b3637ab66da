"""Estimators of whole flights, and the manoeuvres that they are given."""
