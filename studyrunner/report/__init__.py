"""Figures and the HTML page of a result file. Reads the file alone: no study, no scene."""
