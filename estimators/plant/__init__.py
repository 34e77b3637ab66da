"""The linear model of a mode: (derivatives, air) to A, B, C and process noise, and its step from sample to sample."""
