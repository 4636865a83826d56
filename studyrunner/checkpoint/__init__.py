"""The progress of a study, OUT.nc.progress: one SQLite file. A later run continues from what is in the file."""
