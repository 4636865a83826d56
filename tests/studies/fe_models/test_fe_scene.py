"""Reduced models against dense linear algebra, the bundled dovetail and closed forms."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy import linalg
from scipy.sparse import triu

from studies.fe_models.from_files.check import describe_rest
from studies.finite_element import reduction
from studies.finite_element.pairing import ContactSurfaces
from studies.finite_element.reduced_joint import build_fe_scene, prepare_model
from studies.finite_element.solid_mesh import Material, Rotation, assemble_mass, assemble_stiffness, spin_softening
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, Retainer, mean_motion
from studies.finite_element.surfaces import surface_of_nodes
from studies.model_check import check_model
from studies.scene_error import SceneError
from tests.studies.fe_models.plates import Plates
from tests.studies.fe_models.sectors import N_SECTORS, Sector, Z, cubes_on_each_other, wedge_shape
from tests.studies.fe_models.solid_meshes import block, joined


def node_blocks(n_nodes, rows):
    """Equations (3 n, 3 n_nodes) from lists of (node, 3 x 3 block), one list each three equations."""
    matrix = np.zeros((3 * len(rows), 3 * n_nodes), dtype=complex)
    for row, terms in enumerate(rows):
        for node, part in terms:
            matrix[3 * row : 3 * row + 3, 3 * node : 3 * node + 3] += part
    return matrix


def dense_twin(sector, joint, pairs, forms, nodal_diameter, n_modes):
    """Relative stiffness and mass, frequencies and shapes of the static load by constraints and null spaces alone."""
    n_nodes = sector.mesh.n_nodes
    rows = []
    for moving, weights in zip(pairs.moving, pairs.opposite.toarray(), strict=True):
        rows.append([(moving, np.eye(3)), *((node, -weights[node] * np.eye(3)) for node in np.flatnonzero(weights))])
    follow = node_blocks(n_nodes, rows)
    phase = np.exp(2j * np.pi * nodal_diameter / N_SECTORS)
    rows = [
        [(right, np.eye(3)), (left, -phase * joint.cut.axis.pitch())]
        for left, right in zip(joint.cut.left, joint.cut.right, strict=True)
    ]
    held = np.eye(3 * n_nodes)[joint.held.ravel()]
    fixed = np.concatenate([node_blocks(n_nodes, rows), held])
    constraints = np.concatenate([follow, fixed])
    free = linalg.null_space(constraints)
    driven = np.zeros((len(constraints), len(follow)))
    driven[: len(follow)] = linalg.block_diag(*np.swapaxes(pairs.frames, 1, 2))
    driven = driven[:, pairs.present.ravel()]
    stiffness, mass = (forms[name].toarray() for name in ("stiffness", "mass"))
    particular = linalg.lstsq(constraints, driven)[0]
    assert np.allclose(constraints @ particular, driven, atol=1e-9)
    inner = free.conj().T @ stiffness @ free
    shapes = particular - free @ np.linalg.solve(inner, free.conj().T @ stiffness @ particular)
    # the mass may be singular
    inverse = linalg.eigh(free.conj().T @ mass @ free, inner, eigvals_only=True)[::-1][:n_modes]
    return shapes, shapes.conj().T @ stiffness @ shapes, shapes.conj().T @ mass @ shapes, 1.0 / np.sqrt(inverse)


def plane_of_symmetry(sector):
    held = np.zeros((sector.mesh.n_nodes, 3), dtype=bool)
    held[sector.bore] = True
    held[np.abs(sector.mesh.coordinates[:, 2]) < 1e-9, 2] = True
    return held


CASES = {
    "not matching": lambda: Sector("C3D8", "C3D20R", (1, 3, 2), (1, 2, 2)),
    "through the cut faces": lambda: Sector("C3D8", "C3D8", (1, 3, 2), (1, 3, 2), blade_shape=wedge_shape),
    "through the cut faces, not matching": lambda: Sector(
        "C3D10", "C3D8", (1, 2, 1), (1, 5, 2), blade_shape=wedge_shape
    ),
    "plane of symmetry": lambda: Sector("C3D8", "C3D8", (1, 3, 2), (1, 4, 2), blade_shape=wedge_shape),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("nodal_diameter", [0, 2, N_SECTORS // 2])
def test_reduction_against_dense_constraints(name, nodal_diameter):
    sector = CASES[name]()
    joint = sector.joint(held=plane_of_symmetry(sector)) if name == "plane of symmetry" else sector.joint()
    prepared = prepare_model(sector.model(), joint)
    pairs, forms = prepared.pairs, prepared.forms
    load = np.stack([prepared.static_load, joint.load], axis=1)
    n_modes = 5
    found, own, vectors = prepared.reduce(nodal_diameter, n_modes, load)
    shapes, stiffness, mass, frequencies = dense_twin(sector, joint, pairs, forms, nodal_diameter, n_modes)
    n = len(stiffness)
    assert own["stiffness"].shape == (n + n_modes, n + n_modes)
    assert np.iscomplexobj(own["mass"]) == (nodal_diameter == 2)
    for ours, reference in ((own["stiffness"], stiffness), (own["mass"], mass)):
        assert np.abs(ours[:n, :n] - reference).max() < 1e-8 * np.abs(reference).max()
    assert np.allclose(found, frequencies, rtol=1e-8)
    assert np.allclose(np.diag(own["stiffness"])[n:], frequencies**2, rtol=1e-8)
    assert np.abs(vectors[:n] - shapes.conj().T @ load).max() < 1e-8 * np.abs(vectors).max()
    # elastic stiffness, which is not the one of the shapes
    elastic = shapes.conj().T @ forms["elastic"].toarray() @ shapes
    assert np.abs(own["elastic"][:n, :n] - elastic).max() < 1e-7 * np.abs(elastic).max()


def test_pairs_on_cut_faces_and_planes_of_symmetry():
    sector = Sector("C3D8", "C3D8", (1, 3, 2), (1, 4, 2), blade_shape=wedge_shape)
    joint = sector.joint(held=plane_of_symmetry(sector))
    scene = build_fe_scene(sector.model(prestress=False), joint, ReductionOptions(n_modes=4), 1)
    contact, pairs = scene.model.contact, scene.prepared.pairs
    face = 0.04 * 2.0 * 0.2 * np.tan(np.pi / N_SECTORS)
    assert contact.area.sum() == pytest.approx(face, rel=1e-10)
    assert contact.n_contact == 4 * 3
    assert not np.isin(pairs.moving, sector.right).any()
    in_plane = np.abs(pairs.position[:, 2]) < 1e-9
    assert np.array_equal(contact.dofs[:, 2] < 0, in_plane)
    assert np.allclose(np.abs(pairs.frames[in_plane, 2] @ Z), 1.0)
    assert np.allclose(np.linalg.det(pairs.frames), 1.0)
    present = contact.dofs[contact.dofs >= 0]
    assert np.array_equal(present, np.arange(len(present)))
    assert (contact.dofs[:, 0] >= 0).all()
    check_model(scene.model)


def lap_joint(lap=None):
    """Two plates, the lower one clamped; no cyclic symmetry."""
    lap = lap or Plates("C3D8", (4, 2, 1), (6, 3, 1))
    faces = (surface_of_nodes(lap.mesh, name, lap.sets[name]) for name in ("UNDER", "OVER"))
    held = np.zeros((lap.mesh.n_nodes, 3), dtype=bool)
    held[lap.sets["GROUND"]] = True
    tip = mean_motion(lap.sets["TIP"], Z, lap.mesh.n_nodes)
    joint = JointDefinition((ContactSurfaces(*faces, friction_coefficient=0.3),), held, tip, {"tip": tip})
    return FeModel(lap.mesh), joint


def test_plain_assembly_without_cyclic_symmetry():
    model, joint = lap_joint()
    lines = []
    scene = build_fe_scene(model, joint, ReductionOptions(n_modes=6), 5, lines.append)
    assert list(scene.model.linear) == [0]
    assert scene.model.n_sectors == 0
    assert len(lines) >= 3
    check_model(scene.model)
    assert np.array_equal(scene.model.contact.friction_coefficient, np.full(scene.model.contact.n_contact, 0.3))
    assert prepare_model(model, joint).weight.sum() == pytest.approx(7800.0 * 0.02 * 0.005 * 0.08, rel=1e-10)
    # the upper plate as a whole: a rigid relative motion that nothing resists, and that moves its mass
    pairs, linear = scene.prepared.pairs, scene.model.linear[0]
    shift = np.zeros(len(linear.mass))
    motion = np.array([0.3, -0.2, 0.5])
    shift[: 3 * pairs.n_contact] = (pairs.frames @ motion).ravel()
    assert np.abs(linear.stiffness @ shift).max() < 1e-7 * np.abs(linear.stiffness).max() * 0.5
    mass = 7800.0 * 0.02 * 0.005 * 0.04
    # the quasi-static shape of that motion is the motion itself, of the body that is not held
    sign = 1.0 if pairs.moving_name == ("OVER",) else -1.0
    assert shift @ linear.mass @ shift == pytest.approx(mass * motion @ motion, rel=1e-8)
    assert linear.response @ shift == pytest.approx([sign * motion[2]], abs=1e-8)


def bars(lift, load=0.0):
    """Two bars of unit section and length in a row, each held at its far end, which overlap or are apart by `lift`."""
    mesh, low, up = cubes_on_each_other("C3D8", "C3D8", (2, 2, 2), (2, 2, 3), lift, Material(1e9, 0.0, 1000.0))
    z = mesh.coordinates[:, 2]
    held = np.repeat(((z == 0.0) | (z == z.max()))[:, None], 3, axis=1)
    end = mean_motion(up.nodes, -Z, mesh.n_nodes)
    joint = JointDefinition((ContactSurfaces(low, up, 0.1, with_gaps=True),), held, end, {"end": end})
    preload = load * end if load else None
    return build_fe_scene(FeModel(mesh, preload=preload), joint, ReductionOptions(n_modes=6), 1).model


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_force_at_rest_of_bars_that_overlap(friction):
    """Without Poisson's effect it is the stiffness of both in a row times the overlap."""
    model = bars(-1e-4)
    said = describe_rest(model, friction)
    assert float(re.search(r"(\S+) N, 9 of 9 pairs", said)[1]) == pytest.approx(0.5e9 * 1e-4, rel=1e-3)  # four digits


@pytest.mark.parametrize(
    ("lift", "load", "words"),
    [(0.0, 0.0, "no static load"), (1e-4, 1e3, "preload"), (0.0, -1e3, "preload"), (0.0, 1e3, "500 N, 9 of 9 pairs")],
)
def test_the_force_at_rest_of_bars_that_are_loaded(lift, load, words):
    assert words in describe_rest(bars(lift, load), 0.3)


@pytest.mark.parametrize("kind", ["C3D4", "C3D20R"])
def test_more_modes_than_a_singular_mass_has(kind, monkeypatch):
    sector = Sector(kind, kind, (1, 2, 1), (1, 1, 1))
    options = ReductionOptions(nodal_diameter=2, n_modes=100)
    scene = build_fe_scene(sector.model(), sector.joint(), options, 1)
    frequencies = scene.glued_frequencies[2]
    assert len(frequencies) == {"C3D4": 24, "C3D20R": 60}[kind]
    assert np.isfinite(frequencies).all()
    mass = scene.model.linear[2].mass
    n = len(mass) - len(frequencies)
    assert n == 3 * scene.prepared.pairs.n_contact
    assert np.linalg.eigvalsh(mass)[0] > -1e-9
    # by Lanczos' method, as those of a large model
    monkeypatch.setattr(reduction, "_SMALL", 0)
    fewer = build_fe_scene(sector.model(), sector.joint(), ReductionOptions(nodal_diameter=2, n_modes=3), 1)
    assert np.allclose(fewer.glued_frequencies[2], frequencies[:3], rtol=1e-10)


def test_reduced_frequencies_come_down_to_the_exact_ones():
    """Two bricks, one on the other, whose pairs cannot open but slide freely."""
    lower, a = block("C3D8I", (3, 2, 2), lambda points: points * [0.3, 0.2, 0.1])
    upper, b = block("C3D8I", (3, 2, 2), lambda points: points * [0.3, 0.2, 0.15] + [0.0, 0.0, 0.1])
    mesh = joined(lower, upper)
    bottom, top = np.flatnonzero(a[:, 2] == 1.0), lower.n_nodes + np.flatnonzero(b[:, 2] == 0.0)
    held = np.zeros((mesh.n_nodes, 3), dtype=bool)
    held[np.flatnonzero(a[:, 2] == 0.0)] = True
    tip = mean_motion(top, Z, mesh.n_nodes)
    faces = (surface_of_nodes(mesh, name, nodes) for name, nodes in (("TOP", top), ("BOTTOM", bottom)))
    joint = JointDefinition((ContactSurfaces(*faces),), held, tip, {"tip": tip})
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
        model = build_fe_scene(FeModel(mesh), joint, ReductionOptions(n_modes=n_modes), 0).model
        linear, open_ = model.linear[0], model.contact.dofs[:, 0]
        own = lowest(*(np.delete(np.delete(form, open_, 0), open_, 1) for form in (linear.stiffness, linear.mass)))
        # The upper brick slides in two directions and turns: three rigid modes.
        assert np.abs(own[:3]).max() < 1e-9 * own[3]
        assert np.all(own[3:] > exact[3:] * (1.0 - 1e-9))
        errors.append(np.sqrt(own[3:] / exact[3:]) - 1.0)
    assert errors[0].max() < 0.01
    assert errors[1].max() < 0.001


def test_retainer_acts_on_the_mean_relative_displacement():
    model, joint = lap_joint()
    retained = replace(joint, retainer=Retainer(5e6, np.array([2.0, 0.0, 0.0])))
    with_it, without = (build_fe_scene(model, each, ReductionOptions(n_modes=3), 1) for each in (retained, joint))
    added = with_it.model.linear[0].stiffness - without.model.linear[0].stiffness
    shift = np.zeros(len(added))
    relative = without.prepared.pairs.frames @ np.array([0.25, 0.1, -3.0])
    shift[: relative.size] = relative.ravel()
    assert shift @ added @ shift == pytest.approx(5e6 * 0.25**2, rel=1e-10)
    assert np.linalg.matrix_rank(added, tol=1.0) == 1


def test_a_long_body_that_turns_freely_is_not_held():
    """What round-off leaves of its stiffness is 1.5e-13 of an entry; of a blade of 1000 times its thickness 1.6e-10."""
    lap = Plates("C3D8I", (100, 1, 1), (100, 1, 1))
    (model, joint), ground = lap_joint(lap), lap.sets["GROUND"]
    mesh = replace(lap.mesh, coordinates=lap.mesh.coordinates + [5.0, 3.0, 2.0])
    joint.held[ground[1:], 1:] = False
    prepared = prepare_model(replace(model, mesh=mesh), joint)
    with pytest.raises(SceneError, match="nothing holds the glued structure"):
        prepared.frequencies(0, 1)


def test_what_cannot_be_is_said():
    model, joint = lap_joint()
    with pytest.raises(SceneError, match=r"^nodal_diameter: 2;"):
        build_fe_scene(model, joint, ReductionOptions(nodal_diameter=2), 1)
    # free along x, in matrices of few digits, which hold it or push it
    loose = replace(joint, held=joint.held & [False, True, True])
    stiffness, mass = assemble_stiffness(model.mesh), assemble_mass(model.mesh)
    for digits, scale in product((10, 14), (1.001, 1.002)):
        upper = triu(scale * stiffness)
        upper.data = np.array([float(f"{value:.{digits - 1}e}") for value in upper.data])
        free = replace(model, forms={"stiffness": (upper + triu(upper, 1).T).tocsr(), "mass": mass})
        with pytest.raises(SceneError, match="stiffness is singular, as far as the digits of the matrices tell"):
            prepare_model(free, loose).frequencies(0, 1)
    sector = Sector("C3D8", "C3D8", (1, 3, 2), (1, 2, 1))
    mass = assemble_mass(sector.mesh)
    softened = assemble_stiffness(sector.mesh) + spin_softening(mass, Rotation(1e9, np.zeros(3), Z))
    fast = FeModel(sector.mesh, forms={"stiffness": softened, "mass": mass})
    with pytest.raises(SceneError, match="unstable: spin softening exceeds its stiffness"):
        build_fe_scene(fast, sector.joint(), ReductionOptions(), 1)
    slanted = np.zeros((sector.mesh.n_nodes, 3), dtype=bool)
    slanted[sector.bore] = True
    slanted[sector.left, 0] = True
    with pytest.raises(SceneError, match="of a cut face is held in some directions"):
        build_fe_scene(sector.model(), sector.joint(held=slanted), ReductionOptions(), 1)
