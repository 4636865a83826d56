"""How wrong a state is, and what decides the number of harmonics and samples."""
