"""Files that other libraries read (meshio, ansys-mapdl-reader): in a process of its own, within limits."""
