"""Wear on slow time: the march, Euler and BDF2 steps, step limits, loss of a branch, and the error of it all."""
