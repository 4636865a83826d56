"""Matrices of ANSYS: the .full file of a modal analysis, by ansys-mapdl-reader (the project's extra "ansys")."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.fe_models.libraries.errors import library_errors
from studies.fe_models.matrices.matrices import Matrices, assemble, label, of_table, wrong


def read_ansys(path: Path) -> Matrices:
    """Matrices of a .full file, without the rows that ANSYS holds. Raises SceneError about "matrices"."""
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "matrices"):
        from ansys.mapdl import reader

        try:
            file = reader.read_binary(str(path))
        except NotImplementedError as error:
            what = "lumped" if "lumped" in str(error) else "not symmetric"
            remedy = "write them consistent and symmetric: LUMPM,OFF and no CORIOLIS"
            wrong(path.name, f"the matrices are {what}", remedy)
        if not hasattr(file, "load_km"):
            wrong(path.name, "this is no .full file", "write one: HBMAT or WRFULL before the solution")
        reference, stiffness, mass = file.load_km()
        if stiffness is None or mass is None:
            missing = "stiffness" if stiffness is None else "mass"
            wrong(path.name, f"the file has no {missing}", "write the file of a modal analysis")
        held = np.array([[node, direction] for node, direction in file.const], dtype=np.int64).reshape(-1, 2)
    reference = np.asarray(reference, dtype=np.int64)
    labels = label(reference[:, 0], reference[:, 1] + 1, path.name)
    # held rows are in the file, empty
    free = np.flatnonzero(~np.isin(labels, label(held[:, 0], held[:, 1] + 1, path.name)))
    if not free.size:
        wrong(path.name, "no dof that is free", "write the file of the unconstrained bodies")
    parts = {
        name: of_table(path.name, matrix.tocsr()[free][:, free], labels[free])
        for name, matrix in (("stiffness", stiffness), ("mass", mass))
    }
    return assemble(parts, (path.name,), "ansys")
