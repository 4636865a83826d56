"""Scene `dovetail_sector`: one sector of a bladed disk with a dovetail root, from finite elements.

Displacements of the reduced model: first the relative ones u_blade - u_disk, pair by pair in the order normal
(positive when the pair closes), first tangent (axial, to the trailing edge), second tangent (along the flank,
outwards); then modal coordinates of the glued sector. Pairs are numbered intrados (the flank at y > 0, the side that
leads as the disk turns about +z), then extrados; from the leading to the trailing edge; from the inner to the outer
end.

The default mesh density 2 has 2 x 8 x 3 pairs; 1 has 2 x 4 x 2 and frequencies up to 7 % higher, enough for trying
things out; 3 has 2 x 12 x 4 and frequencies within 2 % of the default ones, at about five times the effort; 4
has 2 x 16 x 5 and the finest, 8, has 2 x 32 x 9.

The blade is excited and observed at mid-chord of its tip, perpendicular to the chord, positive to the intrados.
"""

from __future__ import annotations

import numpy as np

from solver.model import ContactInterface, FloatArray, LinearModel, Matrix, ReducedModel, needed_nodal_diameters
from studies.scene_answers import N_MODES, NaturalFrequencies, SurfaceMesh
from studies.scene_error import SceneError
from studies.scenes.dovetail_mesh import DovetailMesh, build_dovetail_mesh, chord_directions
from studies.scenes.dovetail_parameters import Parameters, check_parameters
from studies.scenes.finite_element.assembly import SectorMatrices, assemble_geometric_stiffness, assemble_sector
from studies.scenes.finite_element.contact_pairs import ContactPairs, build_contact_pairs, join_pairs
from studies.scenes.finite_element.cyclic import CyclicSector
from studies.scenes.finite_element.hex_element import HexElements, elasticity_matrix
from studies.scenes.finite_element.reduction import GluedSectorError, SectorReduction, order_sector, solve_glued
from studies.scenes.finite_element.surface import outer_faces

__all__ = ["Parameters", "build"]

SURFACES = ("intrados", "extrados")


def build(parameters: Parameters, n_harmonics: int) -> ReducedModel:
    """Reduced model of the sector for the harmonics 0..n_harmonics of a travelling wave of `nodal_diameter`.

    The centrifugal load enters the static harmonic only, the unit force of 1 N at the tip nodal diameter d only.
    Stress stiffening takes the stress of the linear elastic sector with its flanks glued at the given speed, the usual
    reference state of a modal analysis with prestress: in the blade it follows from equilibrium alone, and how the
    flanks share the load matters only beside them. With spin softening, `-Omega^2` times the mass that moves across
    the axis, it is part of every stiffness, the static one included. Coriolis forces are left out. The damping is
    `loss_factor / omega_1` times the elastic stiffness, omega_1 the first frequency of the glued sector, rad/s, at
    the nodal diameter of the excitation.

    Raises SceneError where the parameters do not go together.
    """
    check_parameters(parameters)
    mesh = build_dovetail_mesh(parameters)
    pairs = build_pairs(mesh)
    reduction, matrices = _prepare(parameters, mesh, pairs)
    elastic = matrices.stiffness if parameters.stress_stiffening else None
    load = parameters.angular_speed**2 * matrices.load
    vectors = np.stack([load, tip_row(parameters, mesh)], axis=1)
    excited = parameters.nodal_diameter
    wanted = needed_nodal_diameters(excited, parameters.n_sectors, n_harmonics)
    linear: dict[int, LinearModel] = {}
    damping = 0.0
    # The excited nodal diameter first: the damping of all of them is scaled by its first frequency.
    for k in sorted({excited, *wanted}, key=lambda k: (k != excited, k)):
        try:
            reduced = reduction.reduce(k, parameters.stuck_modes, elastic, vectors)
        except GluedSectorError as error:
            raise SceneError("rotation_speed", str(parameters.rotation_speed), f"reduce it: {error}") from error
        if k == excited:
            damping = parameters.loss_factor / reduced.frequencies[0]
        if k in wanted:
            static, tip = reduced.vectors.T
            linear[k] = LinearModel(
                mass=reduced.mass,
                damping=damping * reduced.elastic,
                stiffness=_retained(reduced.stiffness, pairs, parameters.retainer),
                load_static=static.real * (k == 0),
                load_harmonic=tip.astype(complex) * (k == excited),
                response=tip.conj()[None, :],
            )
    n_contact = len(pairs.area)
    return ReducedModel(
        linear={k: linear[k] for k in wanted},
        contact=ContactInterface(
            dofs=np.arange(3 * n_contact).reshape(n_contact, 3),
            area=pairs.area,
            gap=np.zeros(n_contact),
            normal_load=np.zeros(n_contact),
            position=pairs.position,
            surface=tuple(np.repeat(SURFACES, n_contact // len(SURFACES)).tolist()),
        ),
        response_names=("tip",),
        n_sectors=parameters.n_sectors,
        nodal_diameter=parameters.nodal_diameter,
    )


def describe_mesh(parameters: Parameters) -> SurfaceMesh:
    """Outer faces of disk and blade; the flanks and the cut faces between sectors are among them.

    Raises SceneError where the parameters do not go together.
    """
    check_parameters(parameters)
    mesh = build_dovetail_mesh(parameters)
    faces, element = outer_faces(mesh.mesh.elements)
    used, quads = np.unique(faces, return_inverse=True)
    return SurfaceMesh(
        nodes=mesh.mesh.nodes[used],
        quads=quads.reshape(faces.shape),
        parts=tuple(np.where(mesh.blade_elements[element], "blade", "disk").tolist()),
    )


def natural_frequencies(parameters: Parameters) -> NaturalFrequencies:
    """Lowest frequencies of the glued sector, with the effects of rotation if wanted, at all nodal diameters 0..N/2.

    Raises SceneError where the parameters do not go together.
    """
    check_parameters(parameters)
    mesh = build_dovetail_mesh(parameters)
    reduction, _ = _prepare(parameters, mesh, build_pairs(mesh))
    nodal_diameters = tuple(range(parameters.n_sectors // 2 + 1))
    frequencies = np.empty((len(nodal_diameters), N_MODES))
    for k in nodal_diameters:
        try:
            frequencies[k] = reduction.frequencies(k, N_MODES) / (2.0 * np.pi)
        except GluedSectorError as error:
            raise SceneError("rotation_speed", str(parameters.rotation_speed), f"reduce it: {error}") from error
    return NaturalFrequencies(nodal_diameters, frequencies)


def _retained(stiffness: Matrix, pairs: ContactPairs, retention_stiffness: float) -> Matrix:
    """Reduced stiffness with the retainer: a spring on the mean axial relative displacement, weighted by area.

    A prismatic slot holds the root along its axis by friction alone. Once every pair slips at some time of the period,
    vibration carries the root along. Under a travelling wave it walks, and without a retainer there is no periodic
    state (measured: at the resonance of nodal diameter 3 and 0.5 N of excitation a force of about 100 N holds it). At
    nodal diameter 0 nothing but unequal wear drives it one way, by 1e-7 of the friction: its mean position is not
    determined (`solver.wear.free_slide`).
    """
    axial = np.zeros(len(stiffness))
    axial[1 : 3 * len(pairs.area) : 3] = pairs.area / pairs.area.sum()
    return stiffness + retention_stiffness * np.outer(axial, axial)


def _prepare(parameters: Parameters, mesh: DovetailMesh, pairs: ContactPairs) -> tuple[SectorReduction, SectorMatrices]:
    """The sector with the effects of rotation if wanted, to be reduced, and its matrices at rest."""
    try:
        hexes = build_elements(parameters, mesh)
    except ValueError as error:
        raise SceneError("mesh", str(parameters.mesh), f"change the geometry: {error}") from error
    matrices = assemble_sector(mesh.mesh, hexes)
    ordered = order_sector(build_sector(parameters, mesh), pairs, matrices.stiffness, mesh.stations)
    stiffness = matrices.stiffness
    if parameters.stress_stiffening:
        rotation = parameters.angular_speed**2
        displacements = solve_glued(ordered, matrices.stiffness, rotation * matrices.load)
        geometric = assemble_geometric_stiffness(mesh.mesh, hexes, displacements)
        stiffness = stiffness + geometric - rotation * matrices.spin_mass
    return SectorReduction(ordered, stiffness, matrices.mass), matrices


def build_elements(parameters: Parameters, mesh: DovetailMesh) -> HexElements:
    """Hexahedra of the sector with the material of the parameters."""
    return HexElements(
        coordinates=mesh.mesh.nodes[mesh.mesh.elements],
        elasticity=elasticity_matrix(parameters.young_modulus, parameters.poisson_ratio),
        density=parameters.density,
    )


def build_pairs(mesh: DovetailMesh) -> ContactPairs:
    """Contact pairs of both flanks, intrados first; the blade moves, the disk is fixed."""
    nodes = mesh.mesh.nodes
    centre = nodes[mesh.blade_flanks].mean(axis=(0, 1, 2))
    return join_pairs(
        tuple(
            build_contact_pairs(nodes, moving=blade, fixed=disk, inside=centre)
            for blade, disk in zip(mesh.blade_flanks, mesh.disk_flanks, strict=True)
        )
    )


def build_sector(parameters: Parameters, mesh: DovetailMesh) -> CyclicSector:
    """Boundary conditions: bore clamped, cut faces tied to the neighbours."""
    return CyclicSector(
        n_nodes=len(mesh.mesh.nodes),
        n_sectors=parameters.n_sectors,
        clamped=mesh.bore_nodes,
        left=mesh.left_nodes,
        right=mesh.right_nodes,
    )


def tip_row(parameters: Parameters, mesh: DovetailMesh) -> FloatArray:
    """Row (3 n_nodes,) that gives the displacement of the tip at mid-chord, perpendicular to the chord there.

    The number of axial stations is even: mid-chord lies halfway between the two middle ones.
    """
    n_across, n_axial = mesh.tip_nodes.shape
    middle = mesh.tip_nodes[n_across // 2, n_axial // 2 - 1 : n_axial // 2 + 1]
    row = np.zeros((len(mesh.mesh.nodes), 3))
    row[middle] = 0.5 * chord_directions(parameters.tip_stagger)[1]
    return row.ravel()
