"""What stands where in a scene file, and in the group `scene` of a result file that keeps one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from solver.model import ReducedModel
from studies.model_check import is_grouped
from studies.scene_answers import SurfaceMesh

CONTACT = {
    "dofs": "whole",
    "area": "real",
    "gap": "real",
    "normal_load": "real",
    "friction_coefficient": "real",
    "position": "real",
    "edge": "flags",
    "surface": "text",
}
"""Fields of the contact pairs, and what their numbers are."""
LINEAR = ("mass", "damping", "stiffness", "load/static", "load/harmonic", "response/dofs", "response/names")
MESH = ("x", "y", "z", "quad", "part")
ATTRIBUTES = ("n_sectors", "nodal_diameter")
ORIGIN = ("model_files", "model_units", "model_reduced_by")
"""Attributes of a file whose scene was reduced here from a finite-element model."""


def scene_attributes(model: ReducedModel) -> dict[str, int]:
    """Attributes of the scene; none where the structure is no sector."""
    if model.n_sectors == 0:
        return {}
    return {"n_sectors": model.n_sectors, "nodal_diameter": model.nodal_diameter}


def scene_datasets(model: ReducedModel, mesh: SurfaceMesh | None) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Name with its groups and values of each dataset; texts as arrays of numpy's type U."""
    contact = model.contact
    for name in list(CONTACT)[:-1]:
        values = getattr(contact, name)
        # without friction coefficients or edges of its own a scene has no such dataset
        if values is not None:
            # HDF5 has no boolean numbers
            yield f"contact/{name}", values.astype(np.int8) if values.dtype.kind == "b" else values
    yield "contact/surface", np.array(contact.surface, dtype=np.str_)
    for k, linear in model.linear.items():
        prefix = f"nd/{k}/" if is_grouped(model) else ""
        for name in ("mass", "damping", "stiffness"):
            yield prefix + name, getattr(linear, name)
        yield f"{prefix}load/static", linear.load_static
        yield f"{prefix}load/harmonic", linear.load_harmonic
        yield f"{prefix}response/dofs", linear.response
        yield f"{prefix}response/names", np.array(model.response_names, dtype=np.str_)
    if mesh is not None:
        for column, axis in enumerate("xyz"):
            yield f"mesh/{axis}", mesh.nodes[:, column]
        yield "mesh/quad", mesh.quads
        yield "mesh/part", np.array(mesh.parts, dtype=np.str_)
