"""The unworn states of a point and the loading history before: a sweep in frequency, or a ramp of the excitation."""
