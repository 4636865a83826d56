"""From a finite-element model of a joint to its reduced model."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from solver.model import ContactInterface, FloatArray, LinearModel, Matrix, ReducedModel, needed_nodal_diameters
from studies.finite_element import solid_mesh
from studies.finite_element.blade_modes import blade_modes
from studies.finite_element.elimination import rounding_of
from studies.finite_element.pairing import ContactPairs
from studies.finite_element.reduction import PreparedModel
from studies.finite_element.structure import FeModel, JointDefinition, ReductionOptions, Structure, build_structure
from studies.scene import WARNING, Progress, silent
from studies.scene_error import SceneError

ABOVE = 1.001
"""Over the frequency of a suspension: beyond it a motion is none as one body."""


@dataclass(frozen=True)
class FeScene:
    """A reduced model, what it was reduced from, with the pairs in the order of the model, and frequencies.

    glued_frequencies: of the glued structure, Hz, ascending, by nodal diameter.
    """

    model: ReducedModel
    prepared: PreparedModel
    glued_frequencies: Mapping[int, FloatArray]


def build_fe_scene(
    model: FeModel,
    joint: JointDefinition,
    options: ReductionOptions,
    n_harmonics: int,
    progress: Progress = silent,
    prepared: PreparedModel | None = None,
) -> FeScene:
    """Reduced model for the harmonics 0..n_harmonics. prepared: the model where `prepare_model` has made it before.

    Displacements of the reduced model: first the relative ones, pair by pair normal (positive when the pair closes),
    first and second tangent; then modal coordinates of the glued structure. The static load, that of the rotation and
    the preload, enters nodal diameter 0 only, the unit harmonic load that of the excitation only, but for a ring. The
    damping is that of the model's matrices, else `loss_factor / omega_1` times the stiffness without prestress where
    that is known, omega_1 the first frequency of the glued structure, rad/s, at the nodal diameter of the excitation
    and above the suspension. Coriolis forces are left out. Raises SceneError where the model describes no possible
    joint.
    """
    excited, n_sectors = options.nodal_diameter, 0 if joint.cut is None else joint.cut.axis.n_sectors
    if excited > n_sectors // 2:
        most = f"use at most n_sectors // 2 = {n_sectors // 2}; more is the same wave turning the other way"
        raise SceneError("nodal_diameter", str(excited), most if n_sectors else "only a cyclic sector has one: use 0")
    prepared = prepared or prepare_model(model, joint, progress)
    wanted, whole = needed_nodal_diameters(excited, n_sectors, n_harmonics), options.all_sectors
    vectors = np.stack([prepared.static_load, joint.load, *joint.responses.values()], axis=1)
    if whole:
        wanted = tuple(range(n_sectors // 2 + 1))
        vectors = np.hstack([vectors, blade_modes(prepared, joint.load)[1]])
    linear: dict[int, LinearModel] = {}
    found: dict[int, FloatArray] = {}
    damping = 0.0
    # The excited nodal diameter first: the damping of all of them is scaled by its first frequency.
    order = sorted({excited, *wanted}, key=lambda k: (k != excited, k))
    for number, k in enumerate(order):
        progress(f"reduction at nodal diameter {k} ({number + 1} of {len(order)})" if n_sectors else "reduction")
        frequencies, forms, generalised = prepared.reduce(k, options.n_modes, vectors)
        found[k] = frequencies / (2.0 * np.pi)
        if k == excited:
            # the suspension of a free structure is none of its material
            elastic = frequencies[frequencies > ABOVE * 2.0 * np.pi * model.suspension]
            damping = options.loss_factor / (elastic if len(elastic) else frequencies)[0]
        if k in wanted:
            static, load, *seen = generalised.T
            responses, blade = np.split(np.array(seen).conj(), [len(joint.responses)])
            linear[k] = LinearModel(
                mass=forms["mass"],
                damping=forms.get("damping", damping * forms.get("elastic", forms["stiffness"])),
                stiffness=_retained(forms["stiffness"], prepared.pairs, joint),
                load_static=static.real * (k == 0),
                load_harmonic=load.astype(complex) * (whole or k == excited),
                response=responses,
                blade=blade if whole else None,
            )
    contact = _interface(prepared.pairs, joint)
    reduced = ReducedModel({k: linear[k] for k in wanted}, contact, tuple(joint.responses), n_sectors, excited)
    return FeScene(reduced, prepared, found)


def prepare_model(model: FeModel, joint: JointDefinition, progress: Progress = silent) -> PreparedModel:
    """Pairs and matrices of a model. Raises SceneError where the model describes no possible joint."""
    progress("pairing of the contact surfaces")
    mesh, rotation, structure, forms = model.mesh, model.rotation, build_structure(model, joint), model.forms
    for note in structure.notes:
        progress(WARNING + note)
    if forms is None:
        progress("assembly of stiffness and mass")
        solid_mesh.check_elements(mesh)
        forms = {"stiffness": solid_mesh.assemble_stiffness(mesh), "mass": solid_mesh.assemble_mass(mesh)}
    mass, placed = forms["mass"], ~np.isnan(mesh.coordinates)
    # springs between each mass and the ground: all modes keep their shapes
    springs = (2.0 * np.pi * model.suspension) ** 2 * mass
    if model.suspension > 0.0:
        forms = {**forms, "stiffness": (forms["stiffness"] + springs).tocsr()}
    load = np.zeros(mass.shape[0]) if model.preload is None else model.preload
    if model.gravity is not None:
        load = load + mass @ (placed * model.gravity).ravel()
    if rotation is not None:
        spin = solid_mesh.centrifugal_load(mass, mesh.coordinates, rotation)
        load = load + spin
    along_x = placed * np.array([1.0, 0.0, 0.0])
    weight = (mass @ along_x.ravel()).reshape(-1, 3)[:, 0] * along_x[:, 0]
    positions = _positions(mesh.coordinates, structure, forms.values())
    rounding = 0.0 if model.forms is None else rounding_of(forms["stiffness"])
    prepared = PreparedModel(structure, forms, positions, load, weight, rotation, rounding)
    if model.forms is not None or not model.prestress or rotation is None:
        return prepared
    progress("static state of the glued structure under the centrifugal load")
    displacements = prepared.solve_static(spin)
    progress("assembly of the prestressed stiffness")
    stressed = solid_mesh.assemble_tangent_stiffness(mesh, displacements)
    stiffness = (stressed + solid_mesh.spin_softening(mass, rotation) + springs).tocsr()
    return replace(prepared, forms={"stiffness": stiffness, "mass": mass, "elastic": forms["stiffness"]})


def _positions(coordinates: FloatArray, structure: Structure, forms: Iterable[sparse.csr_matrix]) -> FloatArray:
    """Coordinates of the nodes, and radius, angle and height of a sector, over the extent of the mesh.

    Nodes without a place stand among those to which forms and constraints couple them. Rounded, layers of a regular
    mesh are layers.
    """
    positions, nowhere = coordinates.copy(), np.asarray(np.isnan(coordinates).any(axis=1))
    if nowhere.any():
        node = sparse.kron(sparse.eye(len(nowhere)), np.ones((1, 3)), format="csr")
        joins = (*forms, structure.constraints.steps.T)
        coupled = sum(node @ (abs(form) > 0.0).astype(float) @ node.T for form in joins).tocsr()
        near = (coupled[nowhere][:, ~nowhere] > 0.0).astype(float)
        count = np.maximum(np.asarray(near.sum(axis=1)), 1.0)
        positions[nowhere] = (near @ positions[~nowhere]) / count.reshape(-1, 1)
    extent = np.ptp(positions, axis=0).max()
    directions = [positions]
    if structure.cut is not None:
        directions.append(structure.cut.axis.cylinder(positions) * [1.0, extent, 1.0])
    return np.asarray(np.round(np.hstack(directions) / extent, 7))


def _interface(pairs: ContactPairs, joint: JointDefinition) -> ContactInterface:
    given = [contact.friction_coefficient for contact in joint.contacts]
    friction = None if None in given else np.array(given, dtype=float)[pairs.surface]
    number = np.cumsum(pairs.present.ravel()).reshape(-1, 3) - 1
    return ContactInterface(
        dofs=np.where(pairs.present, number, -1).astype(np.int64),
        area=pairs.area,
        gap=pairs.gap,
        normal_load=np.zeros(pairs.n_contact),
        position=pairs.position,
        surface=tuple(joint.contacts[place].name for place in pairs.surface),
        friction_coefficient=friction,
    )


def _retained(stiffness: Matrix, pairs: ContactPairs, joint: JointDefinition) -> Matrix:
    if (retainer := joint.retainer) is None:
        return stiffness
    direction = retainer.direction / np.linalg.norm(retainer.direction)
    row = np.zeros(len(stiffness))
    shares = (pairs.frames @ direction) * (pairs.area / pairs.area.sum())[:, None]
    row[: np.count_nonzero(pairs.present)] = shares[pairs.present]
    return stiffness + retainer.stiffness * np.outer(row, row)
