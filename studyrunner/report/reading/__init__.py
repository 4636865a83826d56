"""Reading of a result file: schema check, choice of points, units."""
