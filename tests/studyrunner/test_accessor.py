"""The accessor of result files: complex responses, flanks as grids, loops, files joined."""

import gc
import weakref

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from solver.outcome import Outcome
from studyrunner.accessor import find_grid, join_results
from studyrunner.api import open_result
from tests.studyrunner.results import build_file, write_dataset

SURFACES = ("pressure side", "back")


def flat(across, along):
    """Points (n_across * n_along, 3) of a flank at 45 degrees to the radius x, its upper edge outside; along is z."""
    down, axial = np.meshgrid(across, along, indexing="ij")
    return np.stack([0.245 - down / np.sqrt(2), 0.0055 + down / np.sqrt(2), axial - 0.02], axis=-1).reshape(-1, 3)


def curved(angles, along, radius=0.01):
    angle, axial = np.meshgrid(angles, along, indexing="ij")
    return np.stack([0.3 + radius * np.cos(angle), radius * np.sin(angle), axial], axis=-1).reshape(-1, 3)


PAIR = 7  # the one whose loops are there


@pytest.fixture
def result():
    """Two flanks of 3 x 4 pairs, mirrored, the pairs in an order that says nothing; random values."""
    one = flat([0.0, 0.003, 0.007], np.linspace(0.0, 0.04, 4))
    order = np.random.default_rng(1).permutation(24)
    pairs = {
        "positions": np.concatenate([one, one * [1, -1, 1]])[order],
        "surfaces": np.repeat(SURFACES, 12)[order].tolist(),
        "loops": (PAIR,),
    }
    axes = {"frequency": (100.0, 101.0, 102.0), "scheme": ("b", "a")}
    attributes = {"scene_sha256": "0", "history": "computed", "study": "[scene]\nfriction_coefficient = 0.5\n"}
    found = build_file(axes, (0.0, 1000.0), responses=("tip", "root"), **pairs, **attributes)
    found["phase"].attrs = {"units": "rad"}
    return found


def test_response_is_the_complex_amplitude_of_the_first_harmonic(result):
    response = result.fretwear.response()
    assert response.dims == result.response_amplitude.dims
    np.testing.assert_allclose(np.abs(response), result.response_amplitude)
    quarter = (response * np.exp(0.5j * np.pi)).real
    np.testing.assert_allclose(quarter, result.response_amplitude * np.cos(0.5 * np.pi + result.response_phase))
    assert response.attrs["units"] == "m"


@pytest.mark.parametrize("surface", SURFACES)
def test_flank_puts_every_value_where_its_pair_is(result, surface):
    flank = result.fretwear.flank("wear_depth", surface)
    assert flank.dims == ("frequency", "scheme", "cycle", "across", "along")
    np.testing.assert_allclose(flank.across, [0.0, 0.003, 0.007], rtol=0, atol=1e-9)
    np.testing.assert_allclose(flank.along, np.linspace(0.0, 0.04, 4), rtol=0, atol=1e-9)
    np.testing.assert_allclose(flank.contact_x, (0.245 - flank.across / np.sqrt(2)).broadcast_like(flank[0, 0, 0]))
    np.testing.assert_allclose(flank.contact_z, (flank.along - 0.02).broadcast_like(flank[0, 0, 0]))
    for i, j in np.ndindex(3, 4):
        at = flank[..., i, j]
        assert np.array_equal(at, result.wear_depth.sel(contact=int(at.contact)))
    assert set(result.contact_surface.sel(contact=flank.contact).values.ravel()) == {surface}
    assert flank.across.attrs["units"] == flank.along.attrs["units"] == "m"
    assert flank.attrs == result.wear_depth.attrs


GRIDS = {
    "flank": (flat([0.0, 0.0035, 0.007], np.linspace(0, 0.04, 8)), (3, 8)),
    "unequal spacings": (flat([0.0, 0.001, 0.007], [0.0, 0.001, 0.003, 0.01, 0.04]), (3, 5)),
    "two by two": (flat([0.0, 0.007], [0.0, 0.04]), (2, 2)),
    "one line": (flat([0.0], np.linspace(0, 0.04, 5)), (1, 5)),
    "more lines than pairs a line": (flat(np.linspace(0, 0.007, 9), [0.0, 0.04]), (9, 2)),
    "sheared": (flat([0.0, 0.0035, 0.007], np.linspace(0, 0.04, 8)) @ [[1, 0, 0.3], [0, 1, 0.3], [0, 0, 1]], (3, 8)),
    "curved": (curved(np.linspace(0.1, 2.5, 6), np.linspace(0, 0.01, 4)), (6, 4)),
}


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", GRIDS)
def test_grids_are_found_in_any_orientation_and_order(name, seed):
    points, shape = GRIDS[name]
    random = np.random.default_rng(seed)
    rotation = Rotation.random(rng=random)
    order = random.permutation(len(points))
    noise = 1e-8 * random.uniform(-1, 1, points.shape)
    grid = find_grid(rotation.apply(points)[order] + noise)
    assert grid.pair.shape == shape

    # Pair numbers before rotation and shuffle: lines follow each other, along the axis one way or the other.
    axis = rotation.apply([0.0, 0.0, 1.0])
    upwards = axis[np.argmax(np.abs(axis))] > 0
    expected = np.arange(len(points)).reshape(shape)[:, :: 1 if upwards else -1]
    assert np.array_equal(order[grid.pair], expected)
    steps = np.linalg.norm(np.diff(points.reshape(*shape, 3)[:, 0, :2], axis=0), axis=1)
    np.testing.assert_allclose(np.diff(grid.across), steps, rtol=0, atol=1e-6 if name == "sheared" else 1e-7)
    z = points.reshape(*shape, 3)[0, :, 2]
    np.testing.assert_allclose(grid.along, z - z[0] if upwards else (z[-1] - z)[::-1], rtol=0, atol=1e-7)
    assert grid.across[0] == grid.along[0] == 0.0


def moved(points, shift):
    return points + np.eye(len(points))[:, 5:6] * shift


IRREGULAR = {
    "random": np.random.default_rng(0).normal(size=(12, 3)),
    "one missing": flat([0.0, 0.0035, 0.007], np.linspace(0, 0.04, 8))[1:],
    "one moved along": moved(flat([0.0, 0.0035, 0.007], np.linspace(0, 0.04, 8)), [0, 0, 0.001]),
    "one lifted": moved(flat([0.0, 0.0035, 0.007], np.linspace(0, 0.04, 8)), [0.001, 0.001, 0]),
    "around a pin": curved(np.linspace(0, 2 * np.pi, 12, endpoint=False), np.linspace(0, 0.01, 4)),
    "two in one place": np.repeat(flat([0.0, 0.007], [0.0, 0.04]), 2, axis=0),
    "all in one place": np.zeros((3, 3)),
    "not known": np.full((4, 3), np.nan),
}


@pytest.mark.parametrize("name", IRREGULAR)
def test_what_is_no_grid_is_refused(name):
    with pytest.raises(ValueError, match=r"^(its contact pairs do not|two of its|the positions of its)[^.]*\.$"):
        find_grid(IRREGULAR[name])


def test_loop_is_closed(result):
    loop = result.fretwear.loop(PAIR)
    assert loop.force.dims == ("frequency", "scheme", "cycle", "phase", "component")
    np.testing.assert_allclose(loop.phase, np.linspace(0, 2 * np.pi, 17), rtol=1e-15)
    assert loop.phase.attrs == {"units": "rad"}
    for name in ("force", "displacement"):
        assert np.array_equal(loop[name].isel(phase=0), loop[name].isel(phase=-1))
        assert np.array_equal(loop[name].isel(phase=slice(16)), result[f"loop_{name}"].sel(contact=PAIR))


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda result: result.fretwear.flank("worn_volume", "back"), "worn_volume does not"),
        (lambda result: result.fretwear.flank("wear_depth", "front"), "no surface 'front'"),
        (lambda result: result.isel(contact=slice(1, 20)).fretwear.flank("wear_depth", "back"), "on a grid"),
        (lambda result: result.drop_vars(["loop_force", "loop_displacement"]).fretwear.loop(PAIR), r"loops = \[7\]"),
        (lambda result: result.fretwear.loop(6), r"loops = \[6\]"),
        (lambda result: result.drop_vars("response_phase").fretwear.response(), "no response_phase: give"),
        (lambda result: result.fretwear.loop(99), r"loops = \[99\]"),
        (lambda _: xr.Dataset().fretwear.summary(), "no outcome: give"),
        (lambda _: xr.Dataset().fretwear.outcomes(), "no outcome: give"),
        (lambda _: xr.Dataset().fretwear.surfaces, "no contact_surface: give"),
        (lambda _: xr.Dataset().fretwear.flank("wear_depth", "back"), "no wear_depth and no contact"),
        (lambda result: join_results([result, xr.Dataset()]), "no outcome"),
        (lambda result: result[["wear_depth"]].fretwear.summary(), "no outcome: give"),
        (lambda result: result.isel(cycle=-1, drop=True).fretwear.summary(), "lost its cycle: select"),
        (lambda _: join_results([]), "no results"),
        (lambda result: join_results([result, result.assign_attrs(scene_sha256="1")]), "name the key .* by dim="),
        (lambda result: join_results([result, result.isel(scheme=0)]), "different axes"),
        (lambda result: join_results([result, result.assign_coords(contact_x=2 * result.contact_x)]), "see contact_x"),
        (lambda result: join_results([result, result], dim="gravity"), "gravity is not one value"),
    ],
)
def test_what_is_not_there_or_cannot_be_joined_is_said(ask, words, result):
    with pytest.raises(ValueError, match=words):
        ask(result)


def test_an_opened_result_holds_the_loops_that_were_asked_for_alone(result, tmp_path):
    result.attrs["study"] += f"[outputs]\nloops = [{PAIR}]\n"
    result.to_netcdf(tmp_path / "out.nc")
    with open_result(tmp_path / "out.nc") as opened:
        assert opened["loop_force"].dims == ("frequency", "scheme", "cycle", "loop_contact", "phase", "component")
        assert opened["loop_contact"].values.tolist() == [PAIR]
        assert "'converged'" in repr(opened)
        expected = result.fretwear.loop(PAIR).rename(contact="loop_contact")
        of_pairs = [name for name in result.coords if name.startswith("contact_")]
        assert opened.fretwear.loop(PAIR).drop_vars("ended").equals(expected.drop_vars(of_pairs))
        assert opened.fretwear.outcomes().values.tolist() == [["converged"] * 2] * 3


def test_parts_of_a_result_make_the_result_again(result, tmp_path):
    whole = result.assign_coords(nodal_diameter=[0, 1])
    whole["natural_frequency"] = (("nodal_diameter", "mode"), np.ones((2, 3)))
    parts = [whole.isel(frequency=[0, 2], scheme=[0]), whole.isel(frequency=[1], scheme=[0]), whole.isel(scheme=[1])]
    joined = join_results(parts)
    xr.testing.assert_identical(joined.drop_attrs(deep=False), whole.drop_attrs(deep=False))
    assert joined.attrs == {**whole.attrs, "history": "joined of 3 results\ncomputed"}
    joined.to_netcdf(tmp_path / "joined.nc")
    with xr.open_dataset(tmp_path / "joined.nc") as again:
        assert again.equals(joined)


def test_later_results_win_point_by_point(result):
    later = result.isel(frequency=[1]).copy(deep=True).drop_vars("wear_depth")
    later["worn_volume"][:] = np.nan
    later["outcome"][:] = 1
    result = result.drop_vars("jump_cycle")
    joined = join_results([result, later])
    assert joined.outcome.dtype == np.int8
    assert joined.outcome.values[:, 0].tolist() == [0, 1, 0]
    assert joined.worn_volume[1].isnull().all()
    assert joined.wear_depth[1].isnull().all()
    assert joined.jump_cycle[1].notnull().all()
    assert joined.jump_cycle[::2].isnull().all()
    assert np.array_equal(joined.wear_depth[::2], result.wear_depth[::2])
    assert join_results([later, result]).drop_vars("jump_cycle").equals(result)


def test_a_key_of_the_study_becomes_an_axis(result):
    slippery = result.assign_attrs(study="[scene]\nfriction_coefficient = 0.1\n[solver]\nrtol = 0.1", scene_sha256="1")
    for key in ("friction_coefficient", "scene.friction_coefficient"):
        joined = join_results([result, slippery], dim=key)
        assert joined.worn_volume.dims == ("friction_coefficient", "frequency", "scheme", "cycle")
        assert joined.friction_coefficient.values.tolist() == [0.1, 0.5]
        assert joined.contact_x.equals(result.contact_x)
        assert "study" not in joined.attrs
        assert np.array_equal(joined.wear_depth.sel(friction_coefficient=0.5), result.wear_depth)


def test_points_of_no_result_are_marked(result):
    joined = join_results([result.isel(frequency=[0], scheme=[0]), result.isel(frequency=[2], scheme=[1])])
    assert joined.outcome.values.tolist() == [[0, Outcome.NOT_COMPUTED], [Outcome.NOT_COMPUTED, 0]]
    assert joined.newton_iterations.values.tolist() == [[1, 0], [0, 1]]
    assert joined.worn_volume.isnull().sum() == 4
    assert Outcome.NOT_COMPUTED in joined.outcome.attrs["flag_values"]


def test_a_dataset_that_is_dropped_closes_its_file_at_once(tmp_path):
    """Closed by the garbage collector, while another file is opened, it would crash the netCDF library."""
    write_dataset(build_file(), tmp_path / "result.nc")
    opened = open_result(tmp_path / "result.nc")
    assert opened.fretwear.surfaces
    gone = weakref.ref(opened)
    gc.disable()
    try:
        del opened
        assert gone() is None
    finally:
        gc.enable()
