"""The result file: gathered from the folder of a run, with its provenance and its scene."""
