"""Studies: how well faults are noticed, named and sized on simulated flights whose truth is known."""
