"""Shared by commands and the service: show, exchange and revert a baseline, diagnose a flight, state a user's error."""
