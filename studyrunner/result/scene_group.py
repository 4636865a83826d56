"""The group of a result file with the contents of a scene file, under the same names."""

from __future__ import annotations

from typing import Any

import netCDF4
import numpy as np

from studyrunner.scene.scene import KeptScene
from studyrunner.study.study_of_result import SCENE_GROUP

_COMPLEX = np.dtype([("r", "f8"), ("i", "f8")])
_SAID = {
    "contact/dofs": "closing, first and second tangential relative displacement of each pair; -1 where there is none",
    "contact/area": "weight of the pair, m2",
    "contact/gap": "initial gap, m",
    "contact/normal_load": "constant normal force of pairs without a closing displacement, N, compression positive",
    "contact/friction_coefficient": "friction coefficient of the pair",
    "contact/position": "position of the pair, m",
    "contact/edge": "1 where the bodies go on beyond the pair without pairs, 0 elsewhere",
    "contact/surface": "label of the surface of the pair",
    "mass": "mass matrix, kg",
    "damping": "viscous damping matrix, N s/m",
    "stiffness": "stiffness matrix, N/m",
    "load/static": "static load, N",
    "load/harmonic": "harmonic load, N for an excitation amplitude of 1",
    "response/dofs": "rows that give the responses from the displacements",
    "response/names": "name of each response",
    "mesh/x": "position of the node, x, m",
    "mesh/y": "position of the node, y, m",
    "mesh/z": "position of the node, z, m",
    "mesh/quad": "nodes of the outer face, anticlockwise from outside",
    "mesh/part": "part that the face belongs to",
}


def write_scene_group(file: netCDF4.Dataset, scene: KeptScene) -> None:
    """Writes the group, which reads like a scene file; complex numbers are compounds {r, i}."""
    root = file.createGroup(SCENE_GROUP)
    root.setncattr("comment", "The reduced model that the study was computed with, in the layout of scene files.")
    root.setncatts({name: np.int64(value) for name, value in scene.attributes.items()})
    pair: Any = None
    for key, values in scene.datasets:
        *groups, name = key.split("/")
        group = root.createGroup("/".join(groups)) if groups else root
        dimensions = tuple(_dimension(root, length) for length in values.shape)
        kind: Any = values.dtype
        if kind.kind == "U":
            kind, values = str, values.astype(object)
        elif kind.kind == "c":
            pair = pair or root.createCompoundType(_COMPLEX, "complex")
            kind, values = pair, np.ascontiguousarray(values, np.complex128).view(_COMPLEX)
        packed: Any = {} if kind is str else {"compression": "zlib", "complevel": 1, "shuffle": True}
        variable = group.createVariable(name, kind, dimensions, fill_value=False, **packed)
        variable.setncattr("long_name", _SAID[key.split("/", 2)[-1] if key.startswith("nd/") else key])
        variable[:] = values


def _dimension(root: netCDF4.Group, length: int) -> str:
    """Name of the dimension of a length; a scene file has no names."""
    name = f"length_{length}"
    if name not in root.dimensions:
        root.createDimension(name, length)
    return name
