"""What evidence must reach, in units of log-likelihood, and what change is large enough to matter."""

__all__ = ["ALIKE", "BEYOND_DOUBT", "MATTERS"]

BEYOND_DOUBT = 7.0
"""Evidence that a cause or a missing term needs: odds of a thousand to one."""
ALIKE = 3.0
"""Difference of evidence within which two cannot be distinguished: odds of twenty to one."""
MATTERS = 0.03
"""Part of an output's motion, or of its rms residual, below which a change does not matter."""
