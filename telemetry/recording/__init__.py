"""Recordings: what vehicles sent and what the service said of it, in MCAP files that other tools open, too."""
