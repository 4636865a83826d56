"""The folder of a run, OUT.nc.parts: everything finished is on the disk a moment later, and a run goes on from it."""
