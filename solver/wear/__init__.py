"""Wear on the slow time scale: integration by Euler and BDF2 steps, step limits, loss of a branch, estimated errors."""
