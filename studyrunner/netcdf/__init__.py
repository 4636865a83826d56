"""The result file: written from the folder of a run, with attributes on its origin and with its scene."""
