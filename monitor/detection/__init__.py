"""Detection: evidence of a change, its cause and its size, and the alerts that come of it."""
