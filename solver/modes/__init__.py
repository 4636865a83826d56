"""Nonlinear modes of a joint by the extended periodic motion concept: frequency and damping over the amplitude."""
