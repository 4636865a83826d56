"""The folder of a run, OUT.nc.parts. Finished results are saved at once, so that a later run can continue."""
