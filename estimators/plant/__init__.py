"""The linear model of a mode, stated once: what moves, what the air does, what sensors read."""
