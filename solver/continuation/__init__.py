"""Continuation: natural steps, arc length, homotopies, first state, relaxation in time, states after a fold."""
