"""From a finite-element model of a joint to its reduced model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from solver.model import (
    ContactInterface,
    FloatArray,
    IntArray,
    LinearModel,
    Matrix,
    ReducedModel,
    needed_nodal_diameters,
)
from studies.finite_element.elements.assembly import (
    assemble_mass,
    assemble_stiffness,
    assemble_tangent_stiffness,
    centrifugal_load,
    check_elements,
    spin_softening,
)
from studies.finite_element.elements.solid_mesh import Rotation
from studies.finite_element.joint.constraints import check_followers, free_ones_first
from studies.finite_element.joint.cut_faces import CyclicAxis
from studies.finite_element.joint.layers import find_couplings, find_layers
from studies.finite_element.joint.ordering import (
    Supports,
    consistent_supports,
    order_structure,
    pairs_of_sector,
    ties_of_structure,
)
from studies.finite_element.joint.pairing import ContactPairs, build_contact_pairs
from studies.finite_element.joint.reduction import GluedStructureError, Reduction
from studies.finite_element.joint_model import (
    JointDefinition,
    MatrixModel,
    MeshModel,
    ModelSummary,
    ReductionOptions,
    Retainer,
)
from studies.scene_answers import N_MODES, NaturalFrequencies
from studies.scene_error import SceneError

Progress = Callable[[str], None]
"""Takes a line on the next step."""


@dataclass(frozen=True)
class FeScene:
    """A reduced model, its pairs in the order of the model, and values for a user to check."""

    model: ReducedModel
    pairs: ContactPairs
    summary: ModelSummary


@dataclass(frozen=True)
class PreparedModel:
    """A model that can be reduced at any nodal diameter.

    reduction: with the forms "stiffness" and "mass", "elastic" for the stiffness without prestress where that differs,
    and "damping" where the model has one. static_load (3 n_nodes,): N. at_rest: the reduction without prestress; None
    where that is the same. rotation: None for a model at rest. weight (n_nodes,): kg of each node.
    """

    reduction: Reduction
    static_load: FloatArray
    at_rest: Reduction | None
    rotation: Rotation | None
    weight: FloatArray

    @property
    def pairs(self) -> ContactPairs:
        """Contact pairs."""
        return self.reduction.ordered.pairs

    def forces(self, vectors: FloatArray) -> FloatArray:
        """Nodal forces (3 n_nodes,) on displacements that depend on no other."""
        constraints = self.reduction.ordered.supports.constraints
        return vectors if constraints is None else constraints.forces(vectors)


def silent(_: str) -> None:
    """Prints nothing."""


def build_fe_scene(
    model: MeshModel | MatrixModel,
    joint: JointDefinition,
    options: ReductionOptions,
    n_harmonics: int,
    progress: Progress = silent,
) -> FeScene:
    """Reduced model for the harmonics 0..n_harmonics.

    Displacements of the reduced model: first the relative ones, pair by pair normal (positive when the pair closes),
    first and second tangent; then modal coordinates of the glued structure. The static load, that of the rotation and
    the preload, enters nodal diameter 0 only, the unit harmonic load that of the excitation only. The damping is that
    of the model's matrices, else `loss_factor / omega_1` times the stiffness without prestress where that is known,
    omega_1 the first frequency of the glued structure, rad/s, at the nodal diameter of the excitation. Coriolis forces
    are left out.

    Raises SceneError where the model describes no possible joint.
    """
    excited, n_sectors = options.nodal_diameter, 0 if joint.cut is None else joint.cut.axis.n_sectors
    if excited > n_sectors // 2:
        most = f"use at most n_sectors // 2 = {n_sectors // 2}"
        raise SceneError("nodal_diameter", str(excited), most if n_sectors else "only a cyclic sector has one: use 0")
    wanted = needed_nodal_diameters(excited, n_sectors, n_harmonics)
    prepared = prepare_model(model, joint, progress, n_reductions=len({excited, *wanted}))
    pairs, n_nodes = prepared.pairs, len(model.numbers)
    motions = [prepared.forces(each.row(n_nodes)) for each in (joint.load, *joint.responses.values())]
    vectors = [prepared.static_load, *motions]
    linear: dict[int, LinearModel] = {}
    frequencies: dict[int, FloatArray] = {}
    damping = 0.0
    # The excited nodal diameter first: the damping of all of them is scaled by its first frequency.
    order = sorted({excited, *wanted}, key=lambda k: (k != excited, k))
    for number, k in enumerate(order):
        progress(f"reduction at nodal diameter {k} ({number + 1} of {len(order)})" if n_sectors else "reduction")
        try:
            reduced = prepared.reduction.reduce(k, options.n_modes, np.stack(vectors, axis=1))
        except GluedStructureError as error:
            raise _refused(error, k, model.rotation) from error
        frequencies[k] = reduced.frequencies / (2.0 * np.pi)
        if k == excited:
            damping = options.loss_factor / reduced.frequencies[0]
        if k in wanted:
            static, load, *responses = reduced.vectors.T
            stiffness = reduced.forms["stiffness"]
            linear[k] = LinearModel(
                mass=reduced.forms["mass"],
                damping=reduced.forms.get("damping", damping * reduced.forms.get("elastic", stiffness)),
                stiffness=_retained(stiffness, pairs, joint.retainer),
                load_static=static.real * (k == 0),
                load_harmonic=load.astype(complex) * (k == excited),
                response=np.array(responses).conj(),
            )
    return FeScene(
        model=ReducedModel(
            linear={k: linear[k] for k in wanted},
            contact=_interface(pairs, joint),
            response_names=tuple(joint.responses),
            n_sectors=n_sectors,
            nodal_diameter=excited,
        ),
        pairs=pairs,
        summary=_summary(model, prepared, frequencies),
    )


def prepare_model(
    model: MeshModel | MatrixModel, joint: JointDefinition, progress: Progress = silent, n_reductions: int = 1
) -> PreparedModel:
    """Pairs, order of elimination and matrices of a model.

    n_reductions: at how many nodal diameters the model will be reduced.

    Raises SceneError where the model describes no possible joint.
    """
    progress("pairing of the contact surfaces")
    pairs = joint.pairs
    if pairs is None:
        contacts = joint.contacts if joint.constraints is None else free_ones_first(joint.constraints, joint.contacts)
        pairs = build_contact_pairs(model.coordinates, model.numbers, contacts, _along(model, joint), _axis(joint))
    supports = Supports(model.numbers, joint.held, joint.cut, n_reductions, joint.constraints)
    glued = None
    if joint.ties:
        glued = build_contact_pairs(model.coordinates, model.numbers, joint.ties, _along(model, joint))
    if joint.constraints is not None:
        check_followers(joint.constraints, model.numbers, joint.cut, pairs, glued)
    supports = consistent_supports(supports)
    pairs = pairs_of_sector(pairs, supports)
    ties = None if glued is None else ties_of_structure(glued, supports, pairs)
    if isinstance(model, MatrixModel):
        return _prepare(model, model.forms, joint, supports, pairs, ties)
    progress("assembly of stiffness and mass")
    check_elements(model.mesh)
    elastic, mass = (model.padded(form) for form in (assemble_stiffness(model.mesh), assemble_mass(model.mesh)))
    still = _prepare(model, {"stiffness": elastic, "mass": mass}, joint, supports, pairs, ties)
    if not model.prestress or model.rotation is None:
        return still
    progress("static state of the glued structure under the centrifugal load")
    ordered, constraints = still.reduction.ordered, joint.constraints
    try:
        # by a reduction of its own: the factors of a large model are not to be kept beside those that follow
        centrifugal = still.forces(_centrifugal_load(mass, model.coordinates, model.rotation))
        displacements = Reduction(ordered, still.reduction.forms).solve_static(centrifugal)
    except GluedStructureError as error:
        raise _refused(error, 0, model.rotation) from error
    if constraints is not None:
        displacements = np.asarray(constraints.transformation @ displacements)
    progress("assembly of the prestressed stiffness")
    stressed = assemble_tangent_stiffness(model.mesh, displacements[: 3 * model.mesh.n_nodes])
    stiffness = (model.padded(stressed) + spin_softening(mass, model.rotation)).tocsr()
    forms = {"stiffness": stiffness if constraints is None else constraints.apply(stiffness, stiffness=True)}
    forms |= {"mass": still.reduction.forms["mass"], "elastic": still.reduction.forms["stiffness"]}
    return replace(still, reduction=Reduction(ordered, forms), at_rest=still.reduction)


def _prepare(
    model: MeshModel | MatrixModel,
    forms: dict[str, sparse.csr_matrix],
    joint: JointDefinition,
    supports: Supports,
    pairs: ContactPairs,
    ties: ContactPairs | None,
) -> PreparedModel:
    """A model with the forms as they are, without what depends on others."""
    mass, constraints = forms["mass"], joint.constraints
    load = _static_load(mass, model.coordinates, model)
    along_x = np.where(np.isnan(model.coordinates), 0.0, np.array([1.0, 0.0, 0.0]))
    weight = (mass @ along_x.ravel()).reshape(-1, 3)[:, 0] * along_x[:, 0]
    if constraints is not None:
        forms = {name: constraints.apply(form, stiffness=name == "stiffness") for name, form in forms.items()}
        load = constraints.forces(load)
    coupled = find_couplings(forms["stiffness"])
    if isinstance(model, MatrixModel):
        coupled = coupled + find_couplings(forms["mass"])
    layers = None if isinstance(model, MatrixModel) else model.layers
    places = find_layers(model.coordinates, coupled, joint.cut) if layers is None else layers.astype(float)
    ordered = order_structure(supports, pairs, ties, coupled, places)
    return PreparedModel(Reduction(ordered, forms), load, None, model.rotation, weight)


def glued_frequencies(prepared: PreparedModel, nodal_diameter: int, n_modes: int) -> FloatArray:
    """Lowest natural frequencies (n_modes,) of the glued structure, Hz, ascending.

    Raises SceneError where the glued structure is not held, or unstable.
    """
    try:
        return prepared.reduction.frequencies(nodal_diameter, n_modes) / (2.0 * np.pi)
    except GluedStructureError as error:
        raise _refused(error, nodal_diameter, prepared.rotation) from error


def natural_frequencies(prepared: PreparedModel, n_sectors: int) -> NaturalFrequencies:
    """Lowest natural frequencies of the glued structure at all nodal diameters 0..n_sectors // 2.

    Raises SceneError where the glued structure is not held, or unstable.
    """
    found = np.full((n_sectors // 2 + 1, N_MODES), np.nan)
    for k, row in enumerate(found):
        own = glued_frequencies(prepared, k, N_MODES)
        row[: len(own)] = own
    return NaturalFrequencies(tuple(range(len(found))), found)


def _static_load(mass: sparse.csr_matrix, coordinates: FloatArray, model: MeshModel | MatrixModel) -> FloatArray:
    load = np.zeros(mass.shape[0]) if model.preload is None else model.preload
    if model.gravity is not None:
        load = load + mass @ ((~np.isnan(coordinates)) * model.gravity).ravel()
    return load if model.rotation is None else load + _centrifugal_load(mass, coordinates, model.rotation)


def _centrifugal_load(mass: sparse.csr_matrix, coordinates: FloatArray, rotation: Rotation) -> FloatArray:
    # what has no place has no arm: an amplitude within an element
    places = np.where(np.isnan(coordinates), rotation.point, coordinates)
    return centrifugal_load(mass, places, rotation)


def _along(model: MeshModel | MatrixModel, joint: JointDefinition) -> FloatArray:
    if joint.along is not None:
        return joint.along
    axis = _axis(joint)
    if axis is not None:
        return axis.axis
    return np.array([0.0, 0.0, 1.0]) if model.rotation is None else model.rotation.axis


def _axis(joint: JointDefinition) -> CyclicAxis | None:
    return None if joint.cut is None else joint.cut.axis


def _interface(pairs: ContactPairs, joint: JointDefinition) -> ContactInterface:
    given = [contact.friction_coefficient for contact in joint.contacts]
    friction = None
    if any(each is not None for each in given):
        if any(each is None for each in given):
            missing = joint.contacts[given.index(None)].name
            raise SceneError("friction_coefficient", f"none for {missing}", "give one for every pair of surfaces")
        friction = np.array(given, dtype=float)[pairs.surface]
    return ContactInterface(
        dofs=_contact_dofs(pairs),
        area=pairs.area,
        gap=pairs.gap,
        normal_load=np.zeros(pairs.n_contact),
        position=pairs.position,
        surface=tuple(joint.contacts[place].name for place in pairs.surface),
        friction_coefficient=friction,
    )


def _contact_dofs(pairs: ContactPairs) -> IntArray:
    """Places (n_contact, 3) of the relative displacements in the reduced model, -1 where there is none."""
    number = np.cumsum(pairs.present.ravel()).reshape(-1, 3) - 1
    return np.where(pairs.present, number, -1).astype(np.int64)


def _retained(stiffness: Matrix, pairs: ContactPairs, retainer: Retainer | None) -> Matrix:
    """Reduced stiffness with the retainer."""
    if retainer is None:
        return stiffness
    direction = retainer.direction / np.linalg.norm(retainer.direction)
    row = np.zeros(len(stiffness))
    shares = (pairs.frames @ direction) * (pairs.area / pairs.area.sum())[:, None]
    row[: np.count_nonzero(pairs.present)] = shares[pairs.present]
    return stiffness + retainer.stiffness * np.outer(row, row)


def _summary(
    model: MeshModel | MatrixModel, prepared: PreparedModel, frequencies: dict[int, FloatArray]
) -> ModelSummary:
    weight = prepared.weight
    return ModelSummary(
        mass=float(weight.sum()),
        centre=weight @ np.nan_to_num(model.coordinates) / weight.sum(),
        extent=np.nanmax(model.coordinates, axis=0) - np.nanmin(model.coordinates, axis=0),
        n_dofs=3 * len(prepared.reduction.ordered.free),
        glued_frequencies=frequencies,
    )


def _refused(error: GluedStructureError, nodal_diameter: int, rotation: Rotation | None) -> SceneError:
    if error.unstable:
        speed = "that of the matrices" if rotation is None else f"{np.sqrt(rotation.omega_squared) * 30.0 / np.pi:.6g}"
        return SceneError("rotation_speed", speed, f"reduce it: at nodal diameter {nodal_diameter} {error}")
    return SceneError(
        "clamp",
        f"at nodal diameter {nodal_diameter} {error}",
        "clamp nodes, so that with all contact pairs glued no body can move as a whole",
    )
