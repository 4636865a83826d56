"""Linear finite elements of one sector: hexahedra, cyclic symmetry, contact pairs, reduction. Only numpy and scipy."""
