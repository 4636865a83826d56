"""From an unstructured mesh to a reduced model: surfaces, contact pairs, cut faces, reduction."""
