"""The result file: written from the progress of a run, opened, and read by summary and report."""
