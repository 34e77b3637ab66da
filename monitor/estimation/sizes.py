"""Sizes of changes of derivatives that estimation and detection agree on, as fractions of their natural size."""

__all__ = ["MODEL_ERROR", "TYPICAL_CHANGE"]

MODEL_ERROR = 0.03
"""By how much a block's derivatives may differ from the mean for reasons that the linear model does not know."""

TYPICAL_CHANGE = 0.3
"""Standard deviation of a change of the aircraft in no known pattern."""
