"""The thesis beside us: its result tables as printed, and what wingwatch says on the same plants."""
