"""One vehicle watched: cleaning, estimation, detection and what is remembered of it."""
