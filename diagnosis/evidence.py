"""What evidence must reach, in units of log-likelihood, and what change is large enough to matter."""

__all__ = ["ALIKE", "BEYOND_DOUBT", "MATTERS", "SIMULATION_ERROR"]

BEYOND_DOUBT = 7.0
"""Evidence that a cause or a missing term needs: odds of a thousand to one."""
ALIKE = 3.0
"""Difference of evidence within which two cannot be distinguished: odds of twenty to one."""
MATTERS = 0.03
"""Part of an output's motion, or of its rms residual, below which a change does not matter."""
SIMULATION_ERROR = 0.01
"""Part to which a derivative of the simulation, and the size of a cause, are known at best, one standard deviation: no
simulation is right to the last percent, and what it gets wrong it gets wrong throughout the flight."""
