"""Contact with the neighbouring sector: the sector alone against all sectors of the ring."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from solver import SolverSettings
from solver.loading_history.start_states import FrequencySweep
from solver.model import with_friction
from studies.finite_element import surfaces
from studies.finite_element.reduced_joint import prepare_model
from studies.finite_element.solid_mesh import ElementGroup, SolidMesh
from studies.finite_element.structure import FeModel, JointDefinition
from studies.scenes import underplatform_damper
from tests.studies.fe_models.sectors import stubby

N = 6
STUBBY = stubby(N)
DAMPED = underplatform_damper.Parameters(
    n_sectors=N, tip_angle=0, rim_radius=0.15, platform_radius=0.165, blade_length=0.08, retention_stiffness=0
)
SECTORS = [STUBBY.define_sector(), DAMPED.define_sector()]


def apart(model, joint):
    """Only shrouds join the ring, without nodes on cut faces: the disks are apart, as blades on a stiff disk are."""
    none = np.empty(0, dtype=np.int64)
    return model, replace(joint, cut=replace(joint.cut, left=none, right=none))


def opened(model, joint):
    """A sector whose shrouds are 0.3 mm apart, and turn as the ring turns."""
    (contact,), coordinates = joint.contacts, model.mesh.coordinates.copy()
    coordinates[contact.first.nodes] -= 3e-4 * contact.first.areas_and_normals(coordinates)[1]
    contact = replace(contact, tolerance=1e-3)
    return replace(model, mesh=replace(model.mesh, coordinates=coordinates)), replace(joint, contacts=(contact,))


def whole_ring(model, joint):
    """The ring of a sector, without symmetry: nodes of the cut faces are common, contacts join neighbours."""
    mesh, axis = model.mesh, joint.cut.axis
    n, size = axis.n_sectors, mesh.n_nodes
    node = np.arange(n * size).reshape(n, size)
    for j in range(n):
        node[j][joint.cut.right] = node[(j + 1) % n][joint.cut.left]
    used, own = np.unique(node, return_inverse=True)
    own = own.reshape(n, size)
    coordinates = np.concatenate([axis.turned(mesh.coordinates, j) for j in range(n)])[used]
    groups = tuple(
        ElementGroup(each.kind, own[j][each.nodes], each.numbers + 10000 * j, each.material, f"{each.part}{j}")
        for j in range(n)
        for each in mesh.groups
    )
    ring = SolidMesh(coordinates, np.arange(len(used)) + 1, groups)
    held = np.zeros((len(used), 3), dtype=bool)
    for j in range(n):
        held[own[j]] |= joint.held
    contacts = []
    for each in joint.contacts:
        for j in range(n):
            first = surfaces.surface_of_nodes(ring, f"first {j}", own[j][each.first.nodes])
            second = surfaces.surface_of_nodes(ring, f"second {j}", own[(j + each.sector) % n][each.second.nodes])
            contacts.append(replace(each, first=first, second=second, sector=0, label=f"{each.name}{j}"))
    tip = np.zeros((len(used), 3))
    tip[own[0]] = joint.load.reshape(-1, 3)
    return FeModel(ring), JointDefinition(tuple(contacts), held, tip.ravel(), {"tip": tip.ravel()})


@pytest.mark.parametrize(
    "sector", [*SECTORS, apart(*SECTORS[0]), opened(*SECTORS[0])], ids=["shroud", "damper", "disks apart", "gap"]
)
def test_stuck_frequencies_of_all_waves_are_those_of_the_ring(sector):
    model, joint = sector
    prepared = prepare_model(replace(model, rotation=None), joint)
    twice = [prepared.frequencies(k, 4) for k in range(N // 2 + 1) for _ in range(1 if k in (0, N // 2) else 2)]
    ring = prepare_model(*whole_ring(model, joint)).frequencies(0, 10)
    np.testing.assert_allclose(np.sort(np.concatenate(twice))[:10], ring, rtol=1e-9)


def wedge_force(parameters):
    """Centrifugal force of the wedge, N: of its elements, which are parallelepipeds but for the curvature."""
    model, _ = parameters.define_sector()
    corners = model.mesh.coordinates[model.mesh.groups[-1].nodes]
    volume = np.array([ConvexHull(each).volume for each in corners])
    radius = np.linalg.norm(volume @ corners.mean(axis=1)[:, :2]) / volume.sum()
    return parameters.damper_density * volume.sum() * radius * model.rotation.omega_squared


@pytest.mark.parametrize("friction", [1e-6, 0.3])
def test_a_wedge_is_pressed_by_its_centrifugal_force(friction):
    """Between what the platforms carry while the wedge slides in and out; both alike."""
    parameters = underplatform_damper.Parameters()
    model, settings = with_friction(parameters.build(1), friction), SolverSettings(harmonics=1, samples=16)
    ((_, start),) = FrequencySweep(model, 1e-6, "ramp", settings).states(np.array([100.0]))
    normal = start.state.contact_force_h[:, 0, 0]
    sides = normal.reshape(2, -1).sum(axis=1)
    assert sides[0] == pytest.approx(sides[1], rel=1e-4)
    force, roof = wedge_force(parameters), np.radians(parameters.roof_angle)
    # 1 %: the sides are turned to each other by the angle of the pitch
    least, most = (0.5 * force / (np.cos(roof) + sign * friction * np.sin(roof)) for sign in (1.0, -1.0))
    assert 0.99 * least < sides[0] < 1.01 * most
