"""Estimated errors of states and histories, and the automatic choice of harmonics and samples."""
