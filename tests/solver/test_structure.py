"""Fourier basis, condensed structure, penalty and springs in series with the pairs: full equations, closed forms."""

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from solver import march_wear, with_contact_stiffness
from solver.compliant_contact import LARGEST_CONTACT_STIFFNESS as LARGEST
from solver.model import needed_nodal_diameters, with_friction
from solver.modes.modal_model import LinearMode, modal_model
from solver.structure import condensation
from solver.structure.condensation import build_structure, frequency_slope
from solver.structure.fourier import build_basis, from_complex, to_complex
from solver.structure.harmonic_stiffness import DenseStiffness, SharedStiffness
from solver.structure.penalty import build_penalty
from solver.structure.schur import condense
from studies import build_scene
from tests.references import den_hartog_amplitude, slider_wear_depth
from tests.solver.models import OMEGA, cyclic_model, dovetail, random_model, scene
from tests.solver.reconstruction import harmonic_structure

KINDS = ("3d", "constant_load", "one_tangent", "second_tangent", "normal_only")
AMPLITUDE = 60.0


def test_a_complex_amplitude_is_the_real_part_of_a_rotation_forwards():
    amplitudes = np.array([[0.7 - 0.2j, 1.5j], [-2.0, 0.1 + 0.4j]])
    static = np.array([0.5, -1.0])
    phase = 2 * np.pi * np.arange(16) / 16
    expected = static[:, None] + sum(np.real(amplitudes[:, n - 1, None] * np.exp(1j * n * phase)) for n in (1, 2))
    values_h = from_complex(static, amplitudes)
    assert values_h @ build_basis((1, 2), 16).synthesis == pytest.approx(expected, abs=1e-14)
    assert np.array_equal(to_complex(values_h), amplitudes)
    assert np.array_equal(values_h[:, 0], static)


@given(orders=st.sets(st.integers(1, 30), max_size=8), extra=st.integers(1, 20), seed=st.integers(0, 2**31))
def test_analysis_undoes_synthesis_for_any_orders(orders, extra, seed):
    ascending = tuple(sorted(orders))
    basis = build_basis(ascending, 2 * max(ascending, default=0) + extra)
    values_h = np.random.default_rng(seed).normal(size=(3, 2 * len(orders) + 1))
    assert values_h @ basis.synthesis @ basis.analysis == pytest.approx(values_h, abs=1e-13)


# --- condensation ---


@pytest.mark.parametrize(
    ("model", "orders"),
    [
        (random_model(1, KINDS, 0), (1, 2, 3)),
        (random_model(1, KINDS, 6), (1, 3)),
        (cyclic_model(9, KINDS, 6, 2, 5), (1, 3)),
        (cyclic_model(9, KINDS, 5, 2, 5), (1, 3, 5)),
        (cyclic_model(9, KINDS, 6, 3, 5), (1, 2, 5)),
    ],
    ids=["joint alone", "joint", "folded", "odd", "half"],
)
def test_condensed_equilibrium_and_responses_are_those_of_the_full_structure(model, orders):
    """Each order sees the nodal diameter of its own, not of its place."""
    structure = build_structure(model, OMEGA, AMPLITUDE, orders)
    relative = model.contact.relative
    force_h = np.random.default_rng(2).normal(size=(relative.size, 2 * len(orders) + 1)) * 10.0
    forces, moved, responses = [force_h[:, 0], *to_complex(force_h).T], [], []
    for n, force in zip((0, *orders), forces, strict=True):
        linear = harmonic_structure(model, n)
        stiffness = linear.stiffness.real if n == 0 else linear.stiffness
        load = {0: linear.load_static, 1: AMPLITUDE * linear.load_harmonic}.get(n, 0.0 * linear.load_static)
        right = load.astype(complex)
        right[relative] -= force
        moved.append(
            np.linalg.solve(stiffness + 1j * n * OMEGA * linear.damping - (n * OMEGA) ** 2 * linear.mass, right)
        )
        responses.append(linear.response @ moved[-1])
    displacement_h = from_complex(moved[0].real, np.array(moved[1:]).T)[relative]
    residual = structure.apply(displacement_h) + force_h - structure.force_h
    assert np.abs(residual).max() < 1e-10 * np.abs(force_h).max()
    found = structure.response_h(displacement_h)
    np.testing.assert_allclose(to_complex(found).T, responses[1:], rtol=1e-9)
    np.testing.assert_allclose(found[:, 0], np.real(responses[0]), rtol=1e-9)
    # work of the excitation over a period
    work = np.pi * np.imag(np.vdot(moved[1], AMPLITUDE * harmonic_structure(model, 1).load_harmonic))
    assert structure.input_work(displacement_h) == pytest.approx(work, rel=1e-9)


@pytest.mark.parametrize(("n_sectors", "nodal_diameter"), [(5, 2), (6, 3), (7, 0)])
def test_the_slope_with_the_frequency_is_that_of_differences(n_sectors, nodal_diameter):
    model, orders = cyclic_model(9, KINDS, n_sectors, nodal_diameter, 5), (1, 3, 5)
    relative = model.contact.relative
    u = np.random.default_rng(11).normal(size=(relative.size, 2 * len(orders) + 1))
    slope = frequency_slope(model, OMEGA, AMPLITUDE, orders, u)
    length, values = 1e-5 * OMEGA, []
    for omega in (OMEGA - length, OMEGA + length):
        there = build_structure(model, omega, AMPLITUDE, orders)
        product = there.drive @ to_complex(u)[:, 0] + there.drive_offset
        values.append((there.apply(u) - there.force_h, product, to_complex(there.response_h(u))[:, 0]))
    for found, one, other in zip((slope.force, slope.product, slope.response), *values, strict=True):
        expected = (other - one) / (2.0 * length)
        assert np.abs(found - expected).max() < 1e-6 * np.abs(expected).max()


def test_needed_nodal_diameters_are_folded():
    assert needed_nodal_diameters(3, 47, 3) == (0, 3, 6, 9)
    assert needed_nodal_diameters(20, 47, 3) == (0, 7, 13, 20)  # 40 -> 7, 60 - 47 = 13
    assert needed_nodal_diameters(2, 4, 5) == (0, 2)
    assert needed_nodal_diameters(0, 47, 9) == (0,)
    assert needed_nodal_diameters(4, 0, 9) == (0,)


def test_matrices_that_all_harmonics_share_give_what_a_matrix_for_each_gives(monkeypatch):
    model, orders = scene("dovetail_sector", 5, mesh=1), (1, 2, 3, 5)
    each = build_structure(scene("dovetail_sector", 5, mesh=1), OMEGA, AMPLITUDE, orders)
    monkeypatch.setattr(condensation, "DENSE_BYTES", 0.0)
    shared = build_structure(model, OMEGA, AMPLITUDE, orders)
    assert isinstance(each.moving, DenseStiffness)
    assert isinstance(shared.moving, SharedStiffness)
    # one for all coefficients of friction
    assert build_structure(with_friction(model, 0.5), OMEGA, AMPLITUDE, orders) is shared
    # another first harmonic shares none
    modal = modal_model(model, LinearMode(OMEGA, np.eye(len(model.linear[0].mass))[0], 0.0), 0.0)
    assert isinstance(build_structure(modal, OMEGA, AMPLITUDE, orders).moving, DenseStiffness)
    names = [field.name for field in fields(each) if field.name != "moving"]
    for name in (*names, "dynamic_stiffness"):
        ours, theirs = (np.asarray(getattr(structure, name)) for structure in (shared, each))
        assert ours.shape == theirs.shape
        assert ours.dtype == theirs.dtype
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-14 * np.abs(theirs).max(), err_msg=name)
    displacement_h = np.random.default_rng(0).normal(size=(len(each.force_h), 9))
    expected = each.apply(displacement_h)
    np.testing.assert_allclose(shared.apply(displacement_h), expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())
    for structure in (shared, each):
        roughly = structure.apply(displacement_h, roughly=True)
        np.testing.assert_allclose(roughly, expected, rtol=0.0, atol=1e-6 * np.abs(expected).max())


def test_an_elastic_joint_is_taken_at_displacement_level_near_its_stiffness():
    model = dovetail()
    penalty = build_penalty(model, 2 * np.pi * 212.0, 3)
    assert not penalty.inertial.any()
    full, relative = model.linear[0].stiffness, model.contact.dofs.ravel()
    largest = np.linalg.eigvalsh(condense(full, relative, np.zeros(len(full))).stiffness).max()
    assert (penalty.tangential < largest * 1.5).all()
    assert (penalty.tangential > largest * 1e-3).all()
    assert (penalty.normal > largest * 1e-3).all()


# --- springs in series with the pairs ---

SOFT = 2e11  # N/m3; with the areas of the models about their stiffness


@pytest.mark.parametrize(("wave", "contact_stiffness"), [(False, SOFT), (True, 1e-3 * SOFT), (False, LARGEST)])
def test_contact_forces_move_the_contact_by_the_springs_more(wave, contact_stiffness):
    rigid = cyclic_model(9, KINDS, 6, 2, 5) if wave else random_model(1, KINDS, 4)
    soft = with_contact_stiffness(rigid, contact_stiffness)
    relative, components = rigid.contact.relative, rigid.contact.component_index
    assert soft.contact.relative.tolist() == relative.tolist()
    orders = (1, 2, 3)
    body, joint = (build_structure(model, OMEGA, 60.0, orders) for model in (rigid, soft))
    # forces of the contact that drive the bodies to some motion v, and the motion u of the contact
    moved = np.random.default_rng(2).normal(size=(relative.size, 7)) * 1e-6
    force = body.force_h - body.apply(moved)
    ratio = np.where(components % 3 == 0, 1.0, 2.0 * 0.7 / 1.7)
    springs = contact_stiffness * ratio * rigid.contact.area[components // 3]
    contact = moved - force / springs[:, None]
    assert np.abs(joint.force_h - joint.apply(contact) - force).max() < 1e-9 * np.abs(force).max()
    expected = body.response_h(moved)
    assert joint.response_h(contact) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    # energy: the springs take none, so that what the excitation puts in leaves through the contact or the dampers
    assert joint.input_work(contact) == pytest.approx(body.input_work(moved), rel=1e-8)


@pytest.mark.slow
def test_wear_relaxes_the_spring_that_presses_and_the_contact_in_series():
    """Den Hartog's slider: along the support the contact is rigid beside the mount, across it twice as stiff."""
    springs = {"normal_stiffness": 5e10, "contact_stiffness": 1e15}
    cycles = np.array([0.0, 100.0, 250.0])
    expected = slider_wear_depth(
        cycles,
        lambda friction: den_hartog_amplitude(0.1, 1.6e5, 10.0, friction, 2.0 * np.pi * 160.0),
        wear=1.1e-14,
        # the far end of the pressing spring stays where it is
        load=10.0 / (1.0 + 5e10 / 1e11),
        stiffness=1.0 / (1.0 / 5e10 + 1.0 / 1e11),
    )
    history = march_wear(build_scene("sdof_slider", **springs), 160.0, 10.0, 0.5, 1.1e-14, cycles)
    assert expected[-1] > 0.3 * 10.0 / 5e10
    assert history.wear_depth[:, 0] == pytest.approx(expected, rel=5e-3)
