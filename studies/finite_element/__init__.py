"""From a finite-element model of a joint to its reduced model: elements, contact pairs, cyclic symmetry, reduction."""
