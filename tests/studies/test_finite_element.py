"""Bending, cyclic symmetry and reduction, each on the smallest mesh that shows it."""

import numpy as np
import pytest
from scipy import linalg
from scipy.sparse.linalg import spsolve

from studies.finite_element.cut_faces import CyclicAxis
from studies.finite_element.element_matrices import Material
from studies.finite_element.joint_model import JointDefinition, MeshModel, ReductionOptions, SetMotion
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene, prepare_model
from studies.finite_element.solid_mesh import ElementGroup, SolidMesh, assemble_mass, assemble_stiffness
from studies.finite_element.surfaces import surface_of_nodes
from tests.studies.fe_models.sectors import N_SECTORS, Sector, Z, wedge_shape
from tests.studies.fe_models.solid_meshes import STEEL, block, joined


def test_bending_does_not_lock():
    length, height, width = 1.0, 0.05, 0.04
    # No lateral contraction: the beam formula does not know that the clamped end hinders it.
    material = Material(114e9, 0.0, 4430.0)
    beam = length**3 / (3.0 * material.young_modulus * width * height**3 / 12.0)
    deflections = []
    for kind in ("C3D8I", "C3D8"):
        mesh, reference = block(kind, (10, 1, 1), lambda points: points * [length, height, width], material)
        free = np.repeat(reference[:, 0] > 0.0, 3)
        load = np.zeros((mesh.n_nodes, 3))
        load[reference[:, 0] == 1.0, 1] = 0.25
        solved = spsolve(assemble_stiffness(mesh)[free][:, free].tocsc(), load.ravel()[free])
        deflections.append(solved @ load.ravel()[free])
    assert deflections[0] == pytest.approx(beam, rel=0.005)
    assert deflections[1] < 0.6 * beam


def merged(coordinates, elements):
    """Mesh in which nodes at the same place are one, and the number of each node in it."""
    _, first, number = np.unique(np.round(coordinates, 8), axis=0, return_index=True, return_inverse=True)
    number = number.ravel()
    group = ElementGroup("C3D8I", number[elements], np.arange(len(elements)) + 1, STEEL)
    return SolidMesh(coordinates[first], np.arange(len(first)) + 1, (group,)), number


def test_a_glued_sector_moves_as_the_whole_ring():
    """Natural frequencies and a mode of each nodal diameter; the joint of the sector runs through its cut faces."""
    sector = Sector("C3D8I", "C3D8I", (2, 2, 2), (1, 2, 2), blade_shape=wedge_shape)
    mesh, axis = sector.mesh, CyclicAxis(N_SECTORS, np.zeros(3), Z)
    turns = [axis.turn(2.0 * np.pi * number / N_SECTORS) for number in range(N_SECTORS)]
    elements = np.concatenate([group.nodes for group in mesh.groups])
    ring, number = merged(
        np.concatenate([mesh.coordinates @ turn.T for turn in turns]),
        np.concatenate([elements + place * mesh.n_nodes for place in range(N_SECTORS)]),
    )
    bore = np.unique(number.reshape(N_SECTORS, -1)[:, sector.bore])
    free = np.repeat(~np.isin(np.arange(ring.n_nodes), bore), 3)
    stiffness, mass = (each(ring).toarray()[np.ix_(free, free)] for each in (assemble_stiffness, assemble_mass))
    expected = np.sqrt(linalg.eigh(stiffness, mass, eigvals_only=True))

    prepared = prepare_model(sector.model(prestress=False), sector.joint())
    found = []
    for k in range(N_SECTORS // 2 + 1):
        reduced = prepared.reduction.reduce(k, 6, np.eye(3 * mesh.n_nodes))
        real = k in (0, N_SECTORS // 2)
        assert np.isrealobj(reduced.vectors) == real
        found += [*reduced.frequencies] * (1 if real else 2)
        # Sector j moves with exp(+i j phi): the mode laid around the ring is a mode of the ring.
        mode = reduced.vectors[-6].conj().reshape(-1, 3)
        around = np.zeros((ring.n_nodes, 3), dtype=complex)
        for place, turn in enumerate(turns):
            around[number.reshape(N_SECTORS, -1)[place]] = np.exp(2j * np.pi * k * place / N_SECTORS) * (mode @ turn.T)
        moved = around.ravel()[free]
        residual = stiffness @ moved - reduced.frequencies[0] ** 2 * (mass @ moved)
        assert np.abs(residual).max() < 1e-7 * np.abs(stiffness @ moved).max()
    n_common = 8
    assert np.allclose(np.sort(found)[:n_common], expected[:n_common], rtol=1e-9)


def test_reduced_frequencies_come_down_to_the_exact_ones():
    """Two bricks, one on the other, whose pairs cannot open but slide freely."""
    lower, a = block("C3D8I", (3, 2, 2), lambda points: points * [0.3, 0.2, 0.1])
    upper, b = block("C3D8I", (3, 2, 2), lambda points: points * [0.3, 0.2, 0.15] + [0.0, 0.0, 0.1])
    mesh = joined(lower, upper)
    bottom, top = np.flatnonzero(a[:, 2] == 1.0), lower.n_nodes + np.flatnonzero(b[:, 2] == 0.0)
    held = np.zeros((mesh.n_nodes, 3), dtype=bool)
    held[np.flatnonzero(a[:, 2] == 0.0)] = True
    tip = SetMotion(top, Z)
    surfaces = surface_of_nodes(mesh, "TOP", top), surface_of_nodes(mesh, "BOTTOM", bottom)
    joint = JointDefinition((ContactSurfaces(*surfaces),), held, tip, {"tip": tip})
    stiffness, mass = (each(mesh).toarray() for each in (assemble_stiffness, assemble_mass))
    # The moving nodes close the joint along -z: they follow those below.
    both = np.eye(3 * mesh.n_nodes)
    both[3 * bottom + 2] += both[3 * top + 2]
    kept = ~held.ravel()
    kept[3 * top + 2] = False
    basis = both[kept].T

    def lowest(stiffness, mass):
        return linalg.eigh(stiffness, mass, eigvals_only=True)[:8]

    exact = lowest(*(basis.T @ form @ basis for form in (stiffness, mass)))
    errors = []
    for n_modes in (20, 80):
        model = build_fe_scene(MeshModel(mesh), joint, ReductionOptions(n_modes=n_modes), 0).model
        linear, open_ = model.linear[0], model.contact.dofs[:, 0]
        own = lowest(*(np.delete(np.delete(form, open_, 0), open_, 1) for form in (linear.stiffness, linear.mass)))
        # The upper brick slides in two directions and turns: three rigid modes.
        assert np.abs(own[:3]).max() < 1e-9 * own[3]
        assert np.all(own[3:] > exact[3:] * (1.0 - 1e-9))
        errors.append(np.sqrt(own[3:] / exact[3:]) - 1.0)
    assert errors[0].max() < 0.01
    assert errors[1].max() < 0.001
