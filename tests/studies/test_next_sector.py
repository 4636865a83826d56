"""Contact with the neighbouring sector: the sector alone against all sectors of the ring."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from solver import SolverSettings
from solver.contact.coulomb import SLIP
from solver.harmonic_balance.dlft import Balance
from solver.loading_history.start_states import follow_branch
from solver.model import needed_nodal_diameters
from solver.structure.fourier import from_complex, to_complex
from solver.structure.joint import build_case
from solver.structure.penalty import Penalty
from studies.finite_element.reduced_joint import prepare_model
from studies.scenes import underplatform_damper
from tests.studies.shrouded_ring import reduced_ring, stubby, whole_ring

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


def frequencies_of_sector(model, joint):
    prepared = prepare_model(replace(model, rotation=None), joint)
    return [prepared.frequencies(k, 4) for k in range(N // 2 + 1)]


@pytest.mark.parametrize(
    "sector", [*SECTORS, apart(*SECTORS[0]), opened(*SECTORS[0])], ids=["shroud", "damper", "disks apart", "gap"]
)
def test_stuck_frequencies_of_all_waves_are_those_of_the_ring(sector):
    found = frequencies_of_sector(*sector)
    twice = [each for k, each in enumerate(found) for _ in range(1 if k in (0, N // 2) else 2)]
    ring = prepare_model(*whole_ring(*sector)).frequencies(0, 10)
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
    model, settings = parameters.build(1), SolverSettings(harmonics=1, samples=16)
    ((_, start),) = follow_branch(model, friction, 1e-6, np.array([100.0]), "ramp", settings)
    normal = start.state.contact_force_h[:, 0, 0]
    sides = normal.reshape(2, -1).sum(axis=1)
    assert sides[0] == pytest.approx(sides[1], rel=1e-4)
    force, roof = wedge_force(parameters), np.radians(parameters.roof_angle)
    # 1 %: the sides are turned to each other by the angle of the pitch
    least, most = (0.5 * force / (np.cos(roof) + sign * friction * np.sin(roof)) for sign in (1.0, -1.0))
    assert 0.99 * least < sides[0] < 1.01 * most


@pytest.mark.slow
def test_a_wave_of_the_sector_is_one_of_the_ring():
    """A slipping state: turned from sector to sector, with the phase of the wave, it balances the ring as well.

    The wave turns backwards. The static friction that a state keeps of its history depends on where a period begins,
    and is left out.
    """
    diameter, folded, settings = N - 1, 1, SolverSettings(harmonics=3, samples=96)
    parameters = STUBBY.model_copy(update={"interference": 5e-4, "nodal_diameter": folded, "stuck_modes": 60})
    model = replace(parameters.build(3), nodal_diameter=diameter)
    assert set(model.linear) == set(needed_nodal_diameters(diameter, N, 3)) | {folded}
    first = frequencies_of_sector(*SECTORS[0])[folded][0]
    ((_, start),) = follow_branch(model, 0.3, 30.0, np.array([0.98 * first]), "up", settings)
    state, resolution, sector = start.state, start.resolution, build_case(model, 0.3, start.penalty_omega, settings)
    assert resolution == sector.resolution

    def turned(values_h):
        phases = np.exp(2j * np.pi * diameter * np.arange(N)[:, None] * np.array(resolution.orders) / N)
        parts = [from_complex(values_h[..., 0], phase * to_complex(values_h)) for phase in phases]
        return np.concatenate(parts)

    damping = parameters.loss_factor / (2.0 * np.pi * first)
    ring = reduced_ring(*parameters.define_sector(), diameter, 360, damping)
    penalty = Penalty(*(np.tile(getattr(sector.penalty, each.name), N) for each in fields(Penalty)))
    case = replace(build_case(ring, 0.3, start.penalty_omega, settings), penalty=penalty)
    history = np.tile(state.start_history, (N, 1))
    balance = Balance(case.joint(state.omega, 30.0), history, np.zeros(len(history)))
    motion, force = turned(state.displacement_h), turned(state.contact_force_h)
    found = balance.evaluate(balance.predict(motion, force))
    assert (found.status_t == SLIP).mean() > 1e-3
    vibrating = np.abs(force[:, :, 1:]).max()
    np.testing.assert_allclose(found.force_h[:, :, 1:], force[:, :, 1:], atol=1e-8 * vibrating)
    assert np.abs(found.residual[:, 1:]).max() < 1e-6 * vibrating
