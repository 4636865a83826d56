"""Scenes from the files of a finite-element model: what a study says of them, and how they become a reduced model."""
