"""Solid elements of CalculiX and Abaqus: shape functions, faces, matrices, all elements of a kind at once."""
