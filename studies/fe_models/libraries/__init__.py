"""Files that other libraries read: meshio, ansys-mapdl-reader."""
