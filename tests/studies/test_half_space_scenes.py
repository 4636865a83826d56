"""Cylinder and sphere on a flat: contact, stick zone, wear and width against closed forms."""

import math

import numpy as np
import pytest

from solver import march_wear
from solver.settings import SolverSettings
from studies import build_scene
from studies.scene import ExpectedWear
from studies.scene_error import SceneError
from studies.scenes import scene_parameters
from studies.scenes.cylinder_on_flat import line_worn_depth
from studies.scenes.half_space import composite_modulus, round_up, worn_edge
from studies.scenes.sphere_on_flat import point_worn_depth
from tests.studies.half_space_twin import compliances, limit_depth, pressed, solve_pressed

MU, E, NU = 0.6, 200e9, 0.3
SHEAR = E / (2.0 * (1.0 + NU))
MODULUS = composite_modulus(E, NU)
LINE = {"R": 6e-3, "P": 1.2e5}
POINT = {"R": 10e-3, "P": 100.0}
A_LINE = float(np.sqrt(4.0 * LINE["P"] * LINE["R"] / (np.pi * MODULUS)))
A_POINT = float(np.cbrt(0.75 * POINT["P"] * POINT["R"] / MODULUS))
CYLINDER, SPHERE = (scene_parameters(name)() for name in ("cylinder_on_flat", "sphere_on_flat"))


def observed_order(errors):
    """Slope of the errors over meshes that double."""
    return float(-np.polyfit(np.arange(len(errors)) * np.log(2.0), np.log(np.abs(errors)), 1)[0])


def test_the_pressure_of_the_cylinder_is_that_of_hertz():
    peak, errors = 2.0 * LINE["P"] / (np.pi * A_LINE), []
    for strips in (40, 80, 160):
        model = build_scene("cylinder_on_flat", strips=strips, half_width=1.5 * A_LINE)
        force, _ = pressed(model, LINE["P"] * 0.01)
        pressure, x = force / model.contact.area, model.contact.position[:, 0]
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


def worn(name, cycles, rtol, **values):
    """Unworn and worn state. 1e-13 1/Pa: the joint has worn all that it can after some 1e5 cycles."""
    model, settings = build_scene(name, **values), SolverSettings(harmonics=5, samples=64, rtol=rtol)
    history = march_wear(model, 20.0, 1.0, MU, 1e-13, cycles, sweep="ramp", settings=settings)
    assert history.outcome.complete
    return model, history, history.slip_range[0] > 0.0


@pytest.mark.slow
def test_the_stick_zone_of_the_cylinder_is_that_of_cattaneo():
    model, history, slips = worn("cylinder_on_flat", [0.0], 1e-2, strips=40)
    x, c = np.abs(model.contact.position[:, 0]), A_LINE * np.sqrt(0.5)
    force, _ = pressed(model, LINE["P"] * 0.01)
    assert history.mean_pressure[0] == pytest.approx(force / model.contact.area, rel=1e-6, abs=1.0)
    assert (x[slips] > c).all()
    # twice the friction coefficient times the gap that the contact under the load of the stick zone leaves
    ring = (x > c) & (x < 0.97 * A_LINE)
    assert slips[ring].all()
    exact = MU / LINE["R"] * (x * np.sqrt(np.maximum(x**2 - c**2, 0)) - c**2 * np.arccosh(np.maximum(x / c, 1.0)))
    assert history.slip_range[0][ring] == pytest.approx(exact[ring], abs=0.03 * exact[ring].max())


def mindlin_amplitude(share):
    """Johnson, Eq. (7.42), both bodies, under a share of the force that slides."""
    slope = 3.0 * MU * POINT["P"] * 2.0 * (2.0 - NU) / (16.0 * A_POINT * SHEAR)
    return slope * (1.0 - (1.0 - share) ** (2.0 / 3.0))


@pytest.mark.slow
def test_the_sphere_moves_as_mindlin_says():
    model, history, slips = worn("sphere_on_flat", [0.0, 1e6], 1e-2, patches=8)
    radius, c = np.linalg.norm(model.contact.position, axis=1), A_POINT * np.cbrt(0.5)
    width = float(np.sqrt(model.contact.area[0])) / 2.0
    assert radius[~slips].max() < c + 0.5 * width
    assert radius[slips].min() > c - 0.5 * width
    # its first harmonic is a little less than its amplitude
    assert history.response_peak[0, 0] == pytest.approx(mindlin_amplitude(0.5), rel=0.01)
    # worn to the end: the state of these patches to round-off of the steps, the closed form to their size
    limit = limit_depth(model, ~slips)
    assert history.wear_depth[-1] == pytest.approx(limit, abs=1e-4 * limit.max())
    exact = point_worn_depth(np.linspace(c, 2.0 * c, 2001), POINT["R"], A_POINT, c)
    assert limit.max() == pytest.approx(exact.max(), rel=0.05)


def test_the_limit_state_of_strips_is_that_of_the_half_plane():
    for share in (0.5, 0.75, 0.91):
        c, errors = A_LINE * np.sqrt(1.0 - share), []
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


def worn_by_uniform_slip(name, **values):
    """Half-width, volume and largest depth, rows, while all pairs slide alike and wear by their pressure."""
    model = build_scene(name, **values)
    compliance, contact = compliances(model)[0], model.contact
    load = float(model.linear[0].load_static[2 * contact.n_contact])
    depth, rows = np.zeros(contact.n_contact), []
    radius = np.linalg.norm(contact.position, axis=1)
    while not rows or rows[-1][0] <= 0.85 * radius.max():
        force, _ = solve_pressed(compliance, contact.gap + depth, load)
        rows.append((radius[force > 0.0].max(), depth @ contact.area, depth.max()))
        pressure = force / contact.area
        depth = depth + 0.03 * rows[-1][0] ** 2 / (2.0 * values["R"]) * pressure / pressure.max()
    return np.array(rows)


@pytest.mark.parametrize(
    ("name", "contact", "values"),
    [
        ("cylinder_on_flat", A_LINE, {"R": 6e-3, "strips": 120, "half_width": 5.0 * A_LINE, "stroke": 1e-5}),
        ("sphere_on_flat", A_POINT, {"R": 10e-3, "patches": 14, "half_width": 3.0 * A_POINT, "stroke": 1e-5}),
    ],
)
def test_the_scar_of_gross_slip_is_as_wide_as_its_volume_and_depth_say(name, contact, values):
    line = name == "cylinder_on_flat"
    scar = scene_parameters(name)(**values).scar
    rows = worn_by_uniform_slip(name, **values)
    width = values["half_width"] / (values["strips"] / 2 if line else values["patches"])
    for half_width, volume, depth in rows[1:]:
        by_volume = scar(volume / (0.01 if line else 1.0), math.inf)
        for needed in (by_volume, scar(math.inf, depth)):
            # the margin holds, and is none of twice the width
            assert half_width - 0.5 * width < needed < 1.25 * half_width + width
    assert rows[-1, 0] > 2.5 * contact


def test_a_stroke_slides_where_the_approach_under_the_load_says():
    # the strips move under tangential forces as under normal ones: all slide from mu times the approach on
    model = build_scene("cylinder_on_flat", strips=200, half_width=1.2 * A_LINE)
    _, approach = pressed(model, 1200.0)
    half = CYLINDER.stick_under(0.3 * approach)
    _, without = pressed(model, 1200.0 * (half / A_LINE) ** 2)
    assert MU * (approach - without) == pytest.approx(0.3 * approach, rel=2e-3)
    for factor, slides in ((0.99, False), (1.01, True)):
        stick = CYLINDER.stick_under(factor * MU * approach)
        assert (stick == 0.0) == slides
    found = SPHERE.stick_under(mindlin_amplitude(0.5))
    assert found == pytest.approx(A_POINT * 0.5 ** (1.0 / 3.0), rel=1e-12)
    assert SPHERE.stick_under(1e-3) == 0.0
    assert scene_parameters("sphere_on_flat")(friction_coefficient=0.0).stick_under(1e-9) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values", "load"),
    [("cylinder_on_flat", {"strips": 8}, 1200.0), ("sphere_on_flat", {"patches": 3}, 100.0)],
)
def test_a_sliding_that_is_prescribed_wears_as_archard_says(name, values, load):
    """Also where it is less than what the bodies shear before they slide, 2.2 um of a stroke of the cylinder."""
    for sliding in (1e-6, 1e-5):
        model = build_scene(name, sliding=sliding, **values)
        assert model.response_names == ("slip",)
        cycles, settings = [0.0, 1e-4 / sliding], SolverSettings(harmonics=5, samples=64)
        history = march_wear(model, 20.0, 1.0, MU, 1e-13, cycles, sweep="ramp", settings=settings)
        assert history.outcome.complete
        assert history.worn_volume[-1] == pytest.approx(4.0 * 1e-13 * load * 1e-4, rel=1e-3)
    with pytest.raises(SceneError, match=r"^sliding: 1e-06;"):
        build_scene(name, sliding=1e-6, stroke=1e-5)


def room(name, expected, **values):
    """Half-width, m, that a scene chooses for the wear that is expected."""
    return scene_parameters(name)(**values).with_room_for_wear(expected).half_width


def test_a_stroke_that_nearly_slides_has_room_for_what_partial_slip_wears():
    stroke = 2.15e-6
    stick = CYLINDER.stick_under(stroke)
    assert 0.0 < stick < 0.3 * A_LINE
    found = room("cylinder_on_flat", ExpectedWear(1.0, 1e-3), stroke=stroke)
    assert found == round_up(1.1 * worn_edge(line_worn_depth, A_LINE, stick) * 100 / 99)
    # a wrong unit is no reason not to build
    assert room("cylinder_on_flat", ExpectedWear(1.0, 1e9), stroke=1e-5) == 2.7e-3
    assert room("sphere_on_flat", ExpectedWear(1.0, 1e9), stroke=1e-5) == 5e-3
