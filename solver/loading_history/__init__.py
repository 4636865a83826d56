"""The unworn states of a point: a sweep in frequency, or a ramp of the excitation, that leads there."""
