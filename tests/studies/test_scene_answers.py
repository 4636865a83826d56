"""What scenes tell beside their models: the mesh, natural frequencies, exact answers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg
from scipy.integrate import solve_ivp

from solver.contact.wear_law import ARCHARD, WearLaw, WearTable
from solver.model import LinearModel
from studies.scene import stuck_frequencies
from studies.scenes import build_scene, scene_parameters
from studies.scenes.sdof_slider import DenHartogSlider
from studyrunner.scene.scene import describe_scene
from tests.references import StopsOccurError, den_hartog_amplitude, slider_amplitude, slider_orbit

WEAR = np.array([1.1e-11, 0.0, 1.1e-12])
CYCLES = np.array([0.0, 1e3, 3e4, 1e5])


def answer(frequency=160.0, amplitude=10.0, law=ARCHARD, worn=0.0, **changes):
    return scene_parameters("sdof_slider")(**changes).exact_answer(frequency, amplitude, WEAR, CYCLES, law, worn)


def dovetail(**changes):
    return scene_parameters("dovetail_sector")(mesh=1, **changes)


@pytest.mark.parametrize("ratio", [0.4, 0.55, 0.8, 0.97, 1.1, 1.6, 2.5])
@pytest.mark.parametrize("friction_force", [0.5, 3.0, 6.0, 9.0])
def test_den_hartog_holds_where_the_reference_does_and_has_its_amplitude(ratio, friction_force):
    mass, stiffness, force = 0.1, 1.6e5, 10.0
    omega = ratio * np.sqrt(stiffness / mass)
    own = DenHartogSlider(mass, stiffness, force, omega)
    assert own.amplitude(np.array(0.0)) == pytest.approx(force / abs(stiffness - mass * omega**2), rel=1e-12)
    orbit = slider_orbit(mass, 0.0, stiffness, force, friction_force, omega)
    assert own.holds(friction_force) == ("stick" not in {segment.phase for segment in orbit.segments})
    try:
        expected = den_hartog_amplitude(mass, stiffness, force, friction_force, omega)
    except StopsOccurError:
        assert not own.holds(friction_force)
        return
    assert own.amplitude(np.array(friction_force)) == pytest.approx(expected, rel=1e-12, abs=0.0)
    assert orbit.path(0, ("forward", "backward")) / 4 == pytest.approx(expected, rel=1e-10, abs=0.0)
    assert own.first_harmonic(np.array(friction_force)) == pytest.approx(abs(orbit.harmonic(0)), rel=1e-8, abs=0.0)


def rate_by_hand(law, depth, begun, frequency=160.0):
    """dW/dn over the wear coefficient, of the depth since the start, from the definition of each law."""
    force = 10.0 - 1e5 * (begun + depth)
    slip_work = 4.0 * force * slider_amplitude(0.1, 0.0, 1.6e5, 10.0, 0.5 * force, 2 * np.pi * frequency)
    if law.name == "energy":
        slip_work *= 0.5
    if law.name == "threshold":
        slip_work = max(slip_work - law.threshold * 1e-4, 0.0)
    if law.name == "table":
        across = [np.interp(force / 1e-4, law.table.pressure, column) for column in zip(*law.table.factor, strict=True)]
        slip_work *= np.interp(begun + depth, law.table.depth, across)
    return slip_work * sum((factor for _, factor in law.surfaces), 0.0 if law.surfaces else 1.0) / 1e-4


LAWS = {
    "archard": WearLaw(),
    "energy": WearLaw("energy"),
    "threshold": WearLaw("threshold", threshold=40.0),
    "table": WearLaw("table", table=WearTable((6e4, 9e4), (0.0, 1.5e-5, 4e-5), ((0.5, 2.0, 1.0), (1.5, 0.5, 0.8)))),
    "surfaces": WearLaw(surfaces=(("support", 0.3),)),
}


@pytest.mark.slow
@pytest.mark.parametrize(("law", "begun"), [*((name, 0.0) for name in LAWS), ("table", 2e-5)])
def test_the_slider_wears_by_the_differential_equation_of_its_law(law, begun):
    volume, amplitude = answer(law=LAWS[law], worn=begun)
    counts, limits = WEAR[0] * CYCLES, {"rtol": 1e-11, "atol": 1e-18, "max_step": 1e-9}

    def rate(_, depth):
        return [rate_by_hand(LAWS[law], depth[0], begun)]

    depths = solve_ivp(rate, (0.0, counts[-1]), [0.0], "LSODA", counts, **limits).y[0]
    assert volume[0] == pytest.approx(1e-4 * depths, rel=1e-7, abs=0.0)
    assert not volume[1].any()
    for depth, response in zip(depths, amplitude[0, :, 0], strict=True):
        friction = 0.5 * (10.0 - 1e5 * (begun + depth))
        exact = abs(slider_orbit(0.1, 0.0, 1.6e5, 10.0, friction, 2 * np.pi * 160.0).harmonic(0))
        assert response == pytest.approx(exact, rel=1e-7, abs=0.0)


NO_ANSWER = {
    "damped": {"damping": 1.0},
    "compliant": {"contact_stiffness": 1e13},
    "stops": {"amplitude": 6.0},
    "stops far below resonance": {"frequency": 60.0},
    "singular": {"frequency": np.sqrt(1.6e6) / (6 * np.pi)},
}


@pytest.mark.parametrize("name", NO_ANSWER)
def test_where_the_closed_form_does_not_hold_there_is_no_answer(name):
    for values, shape in zip(answer(**NO_ANSWER[name]), ((3, 4), (3, 4, 1)), strict=True):
        np.testing.assert_array_equal(values, np.full(shape, np.nan))


def test_the_mesh_is_the_skin_of_blade_and_disk():
    mesh, whole = dovetail().describe_mesh(), dovetail().define_sector()[0].mesh
    assert sorted(set(mesh.parts)) == ["blade", "disk"]
    assert np.array_equal(np.unique(mesh.quads), np.arange(len(mesh.nodes)))
    # every edge of a closed skin belongs to two faces, which pass it in opposite directions
    edges = np.concatenate([mesh.quads[:, [i, (i + 1) % 4]] for i in range(4)])
    there, back = (sorted(map(tuple, way.tolist())) for way in (edges, edges[:, ::-1]))
    assert there == back
    # divergence theorem with flat triangles, against the hexahedra of each part cut in the same way from their centre
    for part in ("blade", "disk"):
        chosen = mesh.nodes[mesh.quads[np.array(mesh.parts) == part]]
        volume = sum(np.linalg.det(chosen[:, corners]).sum() / 6.0 for corners in ([0, 1, 2], [0, 2, 3]))
        box = whole.coordinates[np.concatenate([group.nodes for group in whole.groups if group.part == part])]
        edges = np.stack([box[:, 1] - box[:, 0], box[:, 3] - box[:, 0], box[:, 4] - box[:, 0]], axis=1)
        assert volume == pytest.approx(np.linalg.det(edges).sum(), rel=0.1)


def test_the_model_with_its_joint_stuck_has_the_frequencies_of_the_glued_sector():
    parameters = dovetail(nodal_diameter=4, n_sectors=12)
    model = build_scene("dovetail_sector", parameters, 3)
    whole, own = parameters.natural_frequencies(model), stuck_frequencies(model)
    assert list(whole) == list(range(7))
    assert list(own) == list(model.linear) == [0, 4]
    for k, found in own.items():
        assert found == pytest.approx(whole[k], rel=1e-9, abs=0.0)


def test_a_wave_that_travels_backwards_has_the_frequency_of_its_image():
    model = build_scene("dovetail_sector", dovetail(nodal_diameter=4, n_sectors=12), 1)
    found = [describe_scene(replace(model, nodal_diameter=k)).stuck_frequency for k in (4, 8)]
    assert found[0] == found[1] > 0.0


def test_a_displacement_without_mass_has_no_frequency():
    random = np.random.default_rng(3)
    root = random.normal(size=(9, 9))
    stiffness = root @ root.T + np.eye(9)
    mass = np.diag([1.0, 1.0, 2.0, 0.0, 0.5, 0.0, 1.0, 3.0, 0.0])
    # the two masses with others behind them
    model, rest = build_scene("two_masses", scene_parameters("two_masses")(), 1), (np.zeros(9), np.zeros(9, complex))
    linear = LinearModel(mass, np.zeros((9, 9)), stiffness, *rest, np.zeros((2, 9)))
    found = stuck_frequencies(replace(model, linear={0: linear}))[0]
    keep, gone = [0, 2, 4, 6, 7], [3, 5, 8]
    condensed = stiffness[np.ix_(keep, keep)] - stiffness[np.ix_(keep, gone)] @ np.linalg.solve(
        stiffness[np.ix_(gone, gone)], stiffness[np.ix_(gone, keep)]
    )
    values = linalg.eigh(condensed, mass[np.ix_(keep, keep)], eigvals_only=True)
    assert found[:5] == pytest.approx(np.sqrt(values) / (2 * np.pi), rel=1e-10, abs=0.0)
    assert np.isnan(found[5])
