"""The points of a study as a table: dimensions of the result, and columns that have those along which they vary."""
