"""The schema's history, run by ``wingwatch.baselines.connection``; there is no ini file."""
