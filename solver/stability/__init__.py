"""Stability of periodic states: Hill's determinant, period doubling."""
