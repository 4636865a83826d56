"""Samples of a study: which inputs scatter, and which values are drawn of them."""
