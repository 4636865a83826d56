"""A result file as the report reads it: its door, its choice of points, its units."""
