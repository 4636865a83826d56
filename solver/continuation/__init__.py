"""Continuation: steps along a parameter, arc length, first state, relaxation in time, states at a phase lag."""
