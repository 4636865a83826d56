"""Ways to a state: natural steps, arc length, homotopies, the first state, transients, states after a fold."""
