"""Result files with a mesh, for the tests of the root in three dimensions."""

from functools import lru_cache
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studies.finite_element.pairing import ContactPairs
from studies.scene_answers import SurfaceMesh
from studies.scenes.dovetail_parameters import Parameters
from studies.scenes.dovetail_sector import define_sector, describe_mesh
from tests.studyrunner.results import build_file

STUDY = '[study]\nname = "s"\n[scene]\nmodel = "dovetail_sector"\nn_sectors = 47\n'


def parameters(density: int = 1) -> Parameters:
    return Parameters(friction_coefficient=0.5, mesh=density)


@lru_cache
def dovetail_pairs(density: int = 1) -> ContactPairs:
    pairs = define_sector(parameters(density))[1].pairs
    assert pairs is not None
    return pairs


@lru_cache
def dovetail_mesh(density: int) -> SurfaceMesh:
    return describe_mesh(parameters(density))


def with_mesh(dataset: xr.Dataset, mesh: SurfaceMesh) -> xr.Dataset:
    """The file with the variables of a mesh."""
    nodes = {f"mesh_{axis}": ("mesh_node", mesh.nodes[:, i].copy(), {"units": "m"}) for i, axis in enumerate("xyz")}
    quads = (("mesh_quad_index", "mesh_corner"), mesh.quads.astype(np.int32))
    return dataset.assign(**nodes, mesh_quad=quads, mesh_part=("mesh_quad_index", np.array(mesh.parts)))


def dovetail_file(density: int = 1, **options: Any) -> xr.Dataset:
    """A file of the dovetail sector with random numbers. density: of its mesh."""
    pairs = dovetail_pairs(density)
    dataset = build_file(positions=pairs.position.copy(), study=STUDY, **options)
    dataset = dataset.assign_coords(contact_area=("contact", pairs.area.copy(), dataset["contact_area"].attrs))
    return with_mesh(dataset, dovetail_mesh(density))


def volume(nodes: NDArray[np.float64], quads: NDArray[np.int64]) -> float:
    """Volume inside closed faces, m3, by the divergence theorem: a sixth of the sum of triple products of triangles.

    Quadrilaterals are the mean of their two splits, which is exact to second order in what bends them.
    """
    total = 0.0
    for splits in (((0, 1, 2), (0, 2, 3)), ((0, 1, 3), (1, 2, 3))):
        for corners in splits:
            a, b, c = (nodes[quads[:, corner]] for corner in corners)
            total += float(np.einsum("ij,ij->", a, np.cross(b, c))) / 12.0
    return total
