"""The result file: written from the progress of a run, with attributes on its origin and with its scene."""
