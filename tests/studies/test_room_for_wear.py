"""The width of a contact in gross slip against wear that is computed apart from the solver, and what needs none."""

import math

import numpy as np
import pytest

from studies import build_scene
from studies.scenes import scene_parameters, scene_with_room
from studies.scenes.half_space import ExpectedWear, Scar, composite_modulus, round_up
from studies.scenes.hertz import (
    line_half_width,
    line_stick_under_stroke,
    line_worn_edge,
    point_radius,
    point_stick_under_stroke,
)
from tests.studies.half_space_twin import compliances, pressed, solve_pressed

MODULUS = composite_modulus(200e9, 0.3)
A_LINE = line_half_width(1.2e5, 6e-3, MODULUS)
A_POINT = point_radius(100.0, 10e-3, MODULUS)


def room(name, expected, **values):
    kind = scene_parameters(name)
    return dict(scene_with_room(name, kind(**values), expected))["half_width"]


def worn_by_uniform_slip(name, **values):
    """Half-width, volume and largest depth, rows, while all pairs slide alike and wear by their pressure."""
    model = build_scene(name, **values)
    compliance, contact = compliances(model)[0], model.contact
    load = float(model.linear[0].load_static[2 * contact.n_contact])
    depth, rows = np.zeros(contact.n_contact), []
    radius = np.linalg.norm(contact.position, axis=1)
    while True:
        force, _ = solve_pressed(compliance, contact.gap + depth, load)
        rows.append((radius[force > 0.0].max(), depth @ contact.area, depth.max()))
        if rows[-1][0] > 0.85 * radius.max():
            return np.array(rows)
        pressure = force / contact.area
        depth = depth + 0.03 * rows[-1][0] ** 2 / (2.0 * values["R"]) * pressure / pressure.max()


@pytest.mark.parametrize(
    ("name", "contact", "values"),
    [
        ("cylinder_on_flat", A_LINE, {"R": 6e-3, "strips": 120, "half_width": 5.0 * A_LINE, "stroke": 1e-5}),
        ("sphere_on_flat", A_POINT, {"R": 10e-3, "patches": 14, "half_width": 3.0 * A_POINT, "stroke": 1e-5}),
    ],
)
def test_the_scar_of_gross_slip_is_as_wide_as_its_volume_and_depth_say(name, contact, values):
    line = name == "cylinder_on_flat"
    scar = Scar(values["R"], contact, *((3, 1.5) if line else (4, 4.0 / math.pi)))
    rows = worn_by_uniform_slip(name, **values)
    width = values["half_width"] / (values["strips"] / 2 if line else values["patches"])
    for half_width, volume, depth in rows[1:]:
        by_volume = scar.half_width(volume / (0.01 if line else 1.0), math.inf)
        by_depth = scar.half_width(math.inf, depth)
        for needed in (by_volume, by_depth):
            # the margin holds, and is none of twice the width
            assert half_width - 0.5 * width < needed < 1.25 * half_width + width
    assert rows[-1, 0] > 2.5 * contact


def test_a_stroke_slides_where_the_approach_under_the_load_says():
    # the strips move under tangential forces as under normal ones: all slide from mu times the approach on
    model = build_scene("cylinder_on_flat", strips=200, half_width=1.2 * A_LINE)
    _, approach = pressed(model, 1200.0)
    half = line_stick_under_stroke(0.3 * approach, 0.6, 1.2e5, A_LINE, MODULUS, 6e-3)
    _, without = pressed(model, 1200.0 * (half / A_LINE) ** 2)
    assert 0.6 * (approach - without) == pytest.approx(0.3 * approach, rel=2e-3)
    for factor, slides in ((0.99, False), (1.01, True)):
        stick = line_stick_under_stroke(factor * 0.6 * approach, 0.6, 1.2e5, A_LINE, MODULUS, 6e-3)
        assert (stick == 0.0) == slides
    # Johnson, Eq. (7.42), both bodies, under half of the force that slides
    shear = 200e9 / 2.6
    stroke = 3.0 * 0.6 * 100.0 * 2.0 * 1.7 / (16.0 * A_POINT * shear) * (1.0 - 0.5 ** (2.0 / 3.0))
    found = point_stick_under_stroke(stroke, 0.6, 100.0, A_POINT, 200e9, 0.3)
    assert found == pytest.approx(A_POINT * 0.5 ** (1.0 / 3.0), rel=1e-12)
    assert point_stick_under_stroke(1e-3, 0.6, 100.0, A_POINT, 200e9, 0.3) == 0.0
    assert point_stick_under_stroke(1e-9, 0.0, 100.0, A_POINT, 200e9, 0.3) == 0.0


def test_a_stroke_that_nearly_slides_has_room_for_what_partial_slip_wears():
    stroke = 2.15e-6
    stick = line_stick_under_stroke(stroke, 0.6, 1.2e5, A_LINE, MODULUS, 6e-3)
    assert 0.0 < stick < 0.3 * A_LINE
    found = room("cylinder_on_flat", ExpectedWear(1.0, 1e-3), stroke=stroke)
    assert found == round_up(1.1 * line_worn_edge(A_LINE, stick) * 100 / 99)
    # a wrong unit is no reason not to build
    assert room("cylinder_on_flat", ExpectedWear(1.0, 1e9), stroke=1e-5) == 2.7e-3
    assert room("sphere_on_flat", ExpectedWear(1.0, 1e9), stroke=1e-5) == 5e-3
