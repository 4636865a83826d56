"""The linear structure: Fourier basis, condensation on the relative displacements, penalty; and the joint."""
