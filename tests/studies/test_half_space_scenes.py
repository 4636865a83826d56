"""Cylinder and sphere on a flat: compliances against quadrature, contact, stick zone and wear against closed forms."""

from functools import lru_cache

import numpy as np
import pytest
from scipy.integrate import dblquad, quad

from solver import march_wear
from solver.outcome import Outcome
from solver.settings import SolverSettings
from studies import build_scene
from studies.model_check import check_model
from studies.scenes.half_space import composite_modulus, patch_compliance, strip_compliance
from studies.scenes.hertz import (
    line_half_width,
    line_stick_width,
    line_worn_depth,
    point_radius,
    point_stick_radius,
    point_worn_depth,
)
from tests.studies.half_space_twin import limit_depth, pressed

MU, E, NU = 0.6, 200e9, 0.3
MODULUS = composite_modulus(E, NU)
LINE = {"R": 6e-3, "P": 1.2e5}
POINT = {"R": 10e-3, "P": 100.0}
A_LINE = line_half_width(LINE["P"], LINE["R"], MODULUS)
A_POINT = point_radius(POINT["P"], POINT["R"], MODULUS)


def test_strips_move_as_the_integral_over_their_traction_says():
    edges = np.array([0.0, 0.5, 1.1, 1.4, 2.3]) * 1e-3
    found = strip_compliance(np.linspace(0.0, 1e-3, 9), 1e11, 0.01, 0.05)
    assert np.linalg.eigvalsh(found)[0] > 0.0
    assert np.array_equal(found, found.T)
    wide = strip_compliance(edges, 1e11, 0.01, 0.05)
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    for i, j in ((0, 0), (0, 3), (2, 1), (3, 3)):

        def mean(i, j):
            at = [middle[i]] if i == j else None
            own, _ = quad(lambda s: np.log(0.05 / abs(middle[i] - s)), edges[j], edges[j + 1], points=at)
            image, _ = quad(lambda s: np.log(0.05 / abs(middle[i] + s)), edges[j], edges[j + 1])
            return float((own + image) / width[j] / 2.0)

        expected = 2.0 / (np.pi * 1e11 * 0.01) * 0.5 * (mean(i, j) + mean(j, i))
        assert wide[i, j] == pytest.approx(expected, rel=1e-9)


def test_patches_move_as_the_integrals_of_boussinesq_and_cerruti_say():
    width, position = 2e-4, np.array([[1e-4, 1e-4], [5e-4, 3e-4]])
    normal, tangential = patch_compliance(position, width, E, NU)
    shear = E / (2.0 * (1.0 + NU))
    expected_normal = expected_tangential = 0.0
    for sign_x in (1.0, -1.0):
        for sign_y in (1.0, -1.0):
            dx, dy = position[1] - np.array([sign_x, sign_y]) * position[0]

            def over_r(y, x):
                return 1.0 / np.hypot(x, y)

            def over_r3(y, x):
                return x**2 / np.hypot(x, y) ** 3

            bounds = dx - width / 2, dx + width / 2, dy - width / 2, dy + width / 2
            one, other = (dblquad(f, *bounds)[0] / width**2 / 4.0 for f in (over_r, over_r3))
            expected_normal += one / (np.pi * MODULUS)
            expected_tangential += ((1.0 - NU) * one + NU * other) / (np.pi * shear)
    assert normal[0, 1] == pytest.approx(expected_normal, rel=1e-8)
    assert tangential[0, 1] == pytest.approx(expected_tangential, rel=1e-8)
    # a square under uniform pressure, its middle: Johnson, Eq. (3.25), and three images far away
    far = patch_compliance(np.array([[1.0, 1.0]]), width, E, NU)[0][0, 0]
    own = 4.0 * np.arcsinh(1.0) * width / (np.pi * MODULUS * width**2) / 4.0
    assert far == pytest.approx(own, rel=1e-4)
    for each in (normal, tangential):
        assert np.linalg.eigvalsh(each)[0] > 0.0


def observed_order(errors):
    """Slope of the errors over meshes that double."""
    return float(-np.polyfit(np.arange(len(errors)) * np.log(2.0), np.log(np.abs(errors)), 1)[0])


def test_the_pressure_of_the_cylinder_is_that_of_hertz():
    peak, errors = 2.0 * LINE["P"] / (np.pi * A_LINE), []
    for strips in (40, 80, 160):
        model = build_scene("cylinder_on_flat", strips=strips, half_width=1.5 * A_LINE)
        force, _ = pressed(model, LINE["P"] * 0.01)
        pressure = force / model.contact.area
        x = model.contact.position[:, 0]
        exact = peak * np.sqrt(np.maximum(1.0 - (x / A_LINE) ** 2, 0.0))
        assert model.contact.area.sum() == pytest.approx(3.0 * A_LINE * 0.01, rel=1e-12)
        errors.append(float(np.abs(pressure - exact).mean() / peak))
        width = x[1] - x[0]
        assert abs(x[force > 0.0].max() + 0.5 * width - A_LINE) < width
        assert pressure.max() == pytest.approx(peak, rel=0.005)
    assert observed_order(errors) > 1.2
    assert errors[-1] < 1e-3
    assert peak == pytest.approx(836.4e6, rel=1e-3)
    assert pytest.approx(0.09134e-3, rel=1e-4) == A_LINE


def test_the_pressure_of_the_sphere_is_that_of_hertz():
    peak, errors = 1.5 * POINT["P"] / (np.pi * A_POINT**2), []
    for patches in (6, 12, 24):
        model = build_scene("sphere_on_flat", patches=patches, half_width=1.4 * A_POINT)
        force, approach = pressed(model, POINT["P"])
        r = np.linalg.norm(model.contact.position, axis=1)
        exact = peak * np.sqrt(np.maximum(1.0 - (r / A_POINT) ** 2, 0.0))
        errors.append(float(np.abs(force / model.contact.area - exact) @ model.contact.area / POINT["P"]))
    assert observed_order(errors) > 1.0
    assert errors[-1] < 0.01
    assert approach == pytest.approx(A_POINT**2 / POINT["R"], rel=2e-3)
    assert model.contact.area.sum() == pytest.approx(np.pi * (1.4 * A_POINT) ** 2, rel=0.01)


@lru_cache
def worn(name, cycles, harmonics, rtol, **values):
    """Unworn and worn state. 1e-13 1/Pa: the joint has worn all that it can after some 1e5 cycles."""
    model = build_scene(name, **values)
    counts = [0.0] if cycles == 0.0 else [0.0, cycles]
    settings = SolverSettings(harmonics=harmonics, samples=64, rtol=rtol)
    return model, march_wear(model, 20.0, 1.0, MU, 1e-13, counts, sweep="ramp", settings=settings)


@pytest.mark.slow
def test_the_stick_zone_of_the_cylinder_is_that_of_cattaneo():
    model, history = worn("cylinder_on_flat", 0.0, 5, 1e-2, strips=40)
    assert history.outcome is Outcome.CONVERGED
    x, c = np.abs(model.contact.position[:, 0]), line_stick_width(A_LINE, 0.5)
    force, _ = pressed(model, LINE["P"] * 0.01)
    assert history.mean_pressure[0] == pytest.approx(force / model.contact.area, rel=1e-6, abs=1.0)
    slips = history.slip_range[0] > 0.0
    assert (x[slips] > c).all()
    # twice the friction coefficient times the gap that the contact under the load of the stick zone leaves
    ring = (x > c) & (x < 0.97 * A_LINE)
    assert slips[ring].all()
    exact = MU / LINE["R"] * (x * np.sqrt(np.maximum(x**2 - c**2, 0)) - c**2 * np.arccosh(np.maximum(x / c, 1.0)))
    assert history.slip_range[0][ring] == pytest.approx(exact[ring], abs=0.03 * exact[ring].max())


@pytest.mark.slow
def test_the_sphere_moves_as_mindlin_says():
    model, history = worn("sphere_on_flat", 1e6, 5, 1e-3, patches=8)
    assert history.outcome is Outcome.CONVERGED
    radius, c = np.linalg.norm(model.contact.position, axis=1), point_stick_radius(A_POINT, 0.5)
    slips = history.slip_range[0] > 0.0
    width = float(np.sqrt(model.contact.area[0])) / 2.0
    assert radius[~slips].max() < c + 0.5 * width
    assert radius[slips].min() > c - 0.5 * width
    shear = E / (2.0 * (1.0 + NU))
    # Johnson, Eq. (7.42), both bodies; its first harmonic is a little less than its amplitude
    amplitude = 3.0 * MU * POINT["P"] * 2.0 * (2.0 - NU) / (16.0 * A_POINT * shear) * (1.0 - 0.5 ** (2.0 / 3.0))
    assert history.response_peak[0, 0] == pytest.approx(amplitude, rel=0.01)
    # worn to the end: the state of these patches to round-off of the steps, the closed form to their size
    limit = limit_depth(model, ~slips)
    assert history.wear_depth[-1] == pytest.approx(limit, abs=1e-4 * limit.max())
    exact = point_worn_depth(np.linspace(c, 2.0 * c, 2001), POINT["R"], A_POINT, c)
    assert limit.max() == pytest.approx(exact.max(), rel=0.05)


def test_the_limit_state_of_strips_is_that_of_the_half_plane():
    for share in (0.5, 0.75, 0.91):
        c, errors = line_stick_width(A_LINE, share), []
        fine = np.linspace(c, 2.5 * A_LINE, 40001)
        exact = line_worn_depth(fine, LINE["R"], A_LINE, c)
        area = 2.0 * float(np.trapezoid(exact, fine))
        for strips in (50, 100, 200):
            model = build_scene("cylinder_on_flat", strips=strips, Q=share * MU * LINE["P"])
            assert model.contact.position[-1, 0] > 1.3 * A_LINE
            depth = limit_depth(model, np.abs(model.contact.position[:, 0]) < c)
            errors.append(float(depth @ model.contact.area / 0.01 / area - 1.0))
        assert depth.max() == pytest.approx(exact.max(), rel=2e-3)
        assert abs(errors[-1]) < 2e-3
        assert max(np.abs(errors)) < 0.01


@pytest.mark.parametrize(
    ("law", "ratio", "edge", "deepest", "worn"),
    [
        (line_worn_depth, 0.9, 1.0524, 0.0429, 0.0045),
        (line_worn_depth, np.sqrt(0.5), 1.1692, 0.2255, 0.0726),
        (line_worn_depth, 0.5, 1.3273, 0.5476, 0.3170),
        (line_worn_depth, 0.3, 1.5371, 1.0516, 0.9124),
        (point_worn_depth, 0.9, 1.0572, 0.0579, 0.0192),
        (point_worn_depth, 0.5, 1.5027, 1.0523, 2.1094),
    ],
)
def test_the_closed_forms_have_their_published_values(law, ratio, edge, deepest, worn):
    """worn: the area of both sides, or the volume."""
    x = np.linspace(ratio, 2.0, 200001)
    depth = law(x, 0.5, 1.0, ratio)
    assert depth.max() == pytest.approx(deepest, abs=6e-5)
    assert x[depth > 0.0].max() == pytest.approx(edge, abs=6e-5)
    around = 2.0 if law is line_worn_depth else 2.0 * np.pi * x
    assert np.trapezoid(around * depth, x) * 0.5 == pytest.approx(worn, abs=6e-5)
    assert not line_worn_depth(np.array([0.0, 0.5]), 0.5, 1.0, 0.7).any()


@pytest.mark.parametrize("name", ["cylinder_on_flat", "sphere_on_flat"])
@pytest.mark.parametrize("values", [{}, {"stroke": 1e-6}])
def test_the_scenes_are_possible_structures(name, values):
    check_model(build_scene(name, **values), n_harmonics=3)
