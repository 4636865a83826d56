"""Matrices of ANSYS (a .full file) by ansys-mapdl-reader. Runs in the process of `libraries.process`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.libraries.process import Arrays
from studies.scene_error import SceneError


def read_arrays(path: Path) -> Arrays:
    """Both matrices as triplets of one triangle, and node and direction of the rows.

    Rows that ANSYS holds are in the file, empty; they are left out. Raises SceneError, or whatever the library raises.
    """
    from ansys.mapdl import reader

    try:
        file = reader.read_binary(str(path))
    except NotImplementedError as error:
        what = "lumped" if "lumped" in str(error) else "not symmetric"
        found = f"{path.name}: the matrices are {what}"
        remedy = "write them consistent and symmetric: LUMPM, OFF, and no gyroscopic terms"
        raise SceneError("matrices", found, remedy) from None
    if not hasattr(file, "load_km"):
        raise SceneError("matrices", f"{path.name} is no .full file", "write one: HBMAT or WRFULL before the solution")
    reference, stiffness, mass = file.load_km()
    if stiffness is None or mass is None:
        missing = "stiffness" if stiffness is None else "mass"
        raise SceneError("matrices", f"{path.name} has no {missing}", "write the file of a modal analysis")
    held = {(int(node), int(direction)) for node, direction in file.const}
    free = np.array([(int(node), int(direction)) not in held for node, direction in reference], dtype=bool)
    arrays: Arrays = {"node": reference[free, 0].astype(np.int64), "direction": reference[free, 1].astype(np.int64)}
    for name, matrix in (("stiffness", stiffness), ("mass", mass)):
        part = matrix.tocsr()[free][:, free].tocoo()
        arrays[f"{name}_rows"] = part.row.astype(np.int64)
        arrays[f"{name}_columns"] = part.col.astype(np.int64)
        arrays[f"{name}_values"] = part.data
    return arrays
