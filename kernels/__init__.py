"""How numerical kernels are compiled, kept, and given what they work on. It knows nothing of aircraft."""
