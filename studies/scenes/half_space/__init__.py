"""Two elastic half-spaces that touch: influence of tractions on displacements, and the reduced model of the contact."""
