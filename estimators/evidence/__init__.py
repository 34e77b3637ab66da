"""What is done with evidence about derivatives, information J (k, k) and vector h (k,), whoever it comes from.

Both online estimators use it: a mean and covariance that J and h stand for (``information``), how much more blocks
scatter than they say (``dispersion``), what a change of derivatives explains (``change``), what new evidence replaces
of old (``forgetting``), and what is beyond chance (``chance``).
"""
