"""Stability of periodic states: Hill's determinant along a branch, Floquet multipliers of reported states."""
