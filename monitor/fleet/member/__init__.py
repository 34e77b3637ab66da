"""One vehicle as the live fleet knows it."""
