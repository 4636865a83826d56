"""What users of Python import, against exact answers and against the command."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib import pyplot

import fretwear
import solver
import studies
import studyrunner
from fretwear import (
    Block,
    Outcome,
    SolverSettings,
    UserError,
    backbone,
    build_scene,
    frequency_response,
    integrate_mission,
    march_wear,
    open_result,
    read_study,
    response_curve,
    run_study,
)
from studyrunner.cli import main
from tests.solver.models import OMEGA, random_model
from tests.studyrunner.faked_runs import Solver

ROOT = Path(solver.__file__).parents[1]
PACKAGES = (solver, studies, studyrunner)
PYTHON_PAGE = (ROOT / "studyrunner" / "PYTHON.md").read_text(encoding="utf-8")

FREQUENCIES = [160.0, 150.0]
SMALL = {"axes.frequency": np.array(FREQUENCIES), "axes.scheme": ("implicit",), "slow_time.cycles": 4000}
AS_TEXTS = ["axes.frequency=[160.0, 150.0]", "axes.scheme=implicit", "slow_time.cycles=4000"]


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A small study through the public functions."""
    path = tmp_path_factory.mktemp("api") / "slider.nc"
    with run_study(read_study("sdof_slider", SMALL), path, progress=False) as dataset:
        yield dataset


# --- the names ---


def test_every_name_is_there_and_is_said():
    for package in PACKAGES:
        assert package.__doc__
        for name in package.__all__:
            assert getattr(package, name).__name__ == name
            assert name in dir(package)
            assert f"`{name}`" in package.__doc__
            assert getattr(fretwear, name) is getattr(package, name)
        with pytest.raises(AttributeError, match="no attribute 'nothing'"):
            package.nothing  # noqa: B018
    assert {"join_results", "worn_volume_statistics"} <= set(dir(fretwear))
    assert hasattr(xr.Dataset, "fretwear")


@pytest.mark.slow
def test_importing_loads_no_more_than_is_needed():
    """The commands say how many threads there are to be before numpy is loaded; what takes long to load, each rank of
    each run would load."""
    code = """
import sys, solver, studies.scenes, studyrunner
print({'numpy', 'scipy', 'pydantic', 'h5py', 'xarray', 'numba'} & set(sys.modules))
import studyrunner.plan
print({'numba'} & set(sys.modules))
import studyrunner.run
late = {'matplotlib', 'netCDF4', 'pandas', 'rich', 'xarray'}
late |= {'scipy.optimize', 'scipy.spatial', 'scipy.special', 'scipy.stats'}
print(late & set(sys.modules))
import fretwear, xarray
print({'scipy.stats', 'studyrunner.accessor'} & set(sys.modules))
xarray.Dataset().fretwear.surfaces
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["set()"] * 4
    assert "ValueError: The dataset holds no contact_surface" in done.stderr


# --- the pages ---


@pytest.mark.slow
def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", PYTHON_PAGE, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(compile(example, "PYTHON.md", "exec"), names)
    assert np.isfinite(names["result"]["worn_volume"]).all()
    assert set(names["curve"].outcome) == {Outcome.CONVERGED}
    assert names["history"].outcome.complete
    said = capsys.readouterr().out
    assert "1.27e-05 m at 505 Hz, converged" in said
    assert "\n  worn volume " in said
    np.testing.assert_array_equal(names["dataset"].worn_volume, names["history"].worn_volume)


# --- studies ---


@pytest.mark.slow
def test_a_study_gives_what_the_command_gives(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = [word for text in AS_TEXTS for word in ("--set", text)]
    assert main(["sdof_slider", *words, "-o", "command.nc"]) == 0
    with xr.open_dataset("command.nc") as command:
        xr.testing.assert_identical(result.drop_vars(["run_time", "ended"]), command.drop_vars("run_time"))
        with open_result("command.nc") as opened:
            xr.testing.assert_identical(opened.drop_vars("ended"), command)
            assert opened.fretwear.response().dtype == complex


@pytest.mark.slow
def test_a_run_that_is_interrupted_goes_on(tmp_path, monkeypatch):
    path, solver = tmp_path / "out.nc", Solver(monkeypatch)

    def interrupt(_, n_results):
        if n_results == 4:
            raise KeyboardInterrupt

    solver.disturb = interrupt
    with pytest.raises(KeyboardInterrupt, match=r"out.nc holds 1 of 2 points"):
        run_study("sdof_slider", path, overrides=SMALL, progress=False)
    with open_result(path) as partly:
        assert sorted(partly.outcome.values.ravel()) == [Outcome.CONVERGED, Outcome.NOT_COMPUTED]
    solver.begin_again()
    with run_study("sdof_slider", path, overrides=SMALL, progress=False) as again:
        assert set(again.outcome.values.ravel()) == {Outcome.CONVERGED}
    assert solver.n_results == 1


def test_several_processes_do_not_compute_the_same(tmp_path, monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "2")
    with pytest.raises(UserError, match=r"^run_study: processes = 2: "):
        run_study("sdof_slider", tmp_path / "out.nc")
    assert not list(tmp_path.iterdir())


# --- one joint ---


@pytest.mark.slow
def test_one_joint_gives_the_bits_of_a_study(result):
    """In tests BLAS has one thread, as in a run."""
    model = build_scene("sdof_slider")
    there = result.sel(scheme="implicit").isel(response=0).squeeze(drop=True)
    curve = frequency_response(model, FREQUENCIES, 10.0, 0.5)
    np.testing.assert_array_equal(np.abs(curve.response[:, 0]), there.response_amplitude.isel(cycle=0))
    np.testing.assert_array_equal(np.angle(curve.response[:, 0]), there.response_phase.isel(cycle=0))
    np.testing.assert_array_equal(curve.response_peak[:, 0], there.response_peak.isel(cycle=0))
    counts = result.cycle.values
    history = march_wear(model, 160.0, 10.0, 0.5, 1.1e-11, counts[1:], scheme="implicit", step=1000)
    at = there.sel(frequency=160.0)
    np.testing.assert_array_equal(history.cycles, counts)
    for name in ("worn_volume", "wear_rate", "worn_volume_error", "residual"):
        np.testing.assert_array_equal(getattr(history, name), at[name])
    np.testing.assert_array_equal(history.wear_depth[:, 0], at.wear_depth)


@pytest.mark.slow
def test_friction_is_one_number_or_one_of_each_pair_or_that_of_the_model():
    model, settings = random_model(3, ("constant_load_one_tangent",) * 2), SolverSettings(1, 32)
    own = replace(model, contact=replace(model.contact, friction_coefficient=np.array([0.2, 0.6])))
    at = OMEGA / (2.0 * np.pi), 120.0
    one, same, other = (
        frequency_response(model, *at, given, settings=settings).response for given in (0.4, [0.4, 0.4], [0.2, 0.6])
    )
    np.testing.assert_array_equal(one, same)
    assert one[0, 0] != other[0, 0]
    step = {"scheme": "implicit", "step": 10.0, "settings": settings}
    given, taken = (march_wear(of, *at, mu, 1e-11, 10.0, **step) for of, mu in ((model, [0.2, 0.6]), (own, None)))
    assert given.worn_volume[-1] > 0.0
    np.testing.assert_array_equal(given.response[0], other[0])
    np.testing.assert_array_equal(given.wear_depth, taken.wear_depth)


def test_results_are_datasets_files_pictures_and_five_lines(tmp_path):
    model = build_scene("sdof_slider")
    assert len(repr(model).splitlines()) == 3
    missions = integrate_mission([Block(model, 160.0, 10.0, 0.5, cycles=10.0)], 1.1e-11, [0, 10])
    assert missions.to_xarray().sizes == {"mission": 2, "contact": 1, "block": 1, "response": 1, "end": 2, "step": 5}
    curve, mode = frequency_response(model, FREQUENCIES, 10.0, 0.5), backbone(model, 1e-3, 0.5, sweep="down")
    whole = response_curve(model, (150.0, 152.0), 10.0, 0.5, settings=SolverSettings(harmonics=3), errors=False)
    for found, index, value in (
        (march_wear(model, 160.0, 10.0, 0.5, 1.1e-11, 1e4), "cycle", "worn_volume"),
        (missions, "mission", "worn_volume"),
        (curve, "frequency", "response_peak"),
        (whole, "point", "frequency"),
        (mode, "modal_amplitude", "damping_ratio"),
    ):
        lines = repr(found).splitlines()
        assert len(lines) == 5
        assert lines[0].startswith(f"{type(found).__name__}: ")
        assert "converged" in lines[0] + lines[1]
        found.to_xarray().to_netcdf(tmp_path / "found.nc")
        with xr.open_dataset(tmp_path / "found.nc") as dataset:
            assert dataset[value].dims[0] == index
            np.testing.assert_array_equal(dataset[value], getattr(found, value))
            assert dataset.outcome.values.ravel()[0] == "converged"
            if found is not missions:
                rebuilt = dataset.response_amplitude * np.exp(1j * dataset.response_phase)
                np.testing.assert_allclose(rebuilt, found.response, rtol=1e-14)
            else:
                np.testing.assert_array_equal(dataset.response_amplitude_end, np.abs(missions.response_end))
        axes = found.plot()
        assert axes.lines
        pyplot.close(axes.figure)
