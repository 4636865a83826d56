"""Whether a periodic state is one that the vibration stays at: Hill's determinant, period doubling."""
