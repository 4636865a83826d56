"""Trends of a study of several axes: worn volume, peak response and shift of the resonance along each of them."""
