"""Telemetry: the sample, how it arrives, and what is done before an estimator may see it."""

from wingwatch.telemetry.sample import CHANNEL_INDEX, CHANNEL_NAMES, CHANNELS, Channel, SampleBlock

__all__ = ["Channel", "CHANNELS", "CHANNEL_INDEX", "CHANNEL_NAMES", "SampleBlock"]
