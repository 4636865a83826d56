"""What is computed again of a worn joint is what a study gives that holds it, or that begins with its depths."""

import shutil

import h5py
import numpy as np
import pytest
import xarray as xr

from studyrunner import UserError, compute_worn_joint, run_study
from studyrunner.report import contents
from studyrunner.report.cli import main

COARSE = {"solver.harmonics": 3, "solver.samples": 64, "slow_time.cycles": 8000.0, "slow_time.outputs": 3}
POINTS = {"axes.frequency": [150.0, 160.0], "axes.scheme": "adaptive", "outputs.loops": [0]}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    found = tmp_path_factory.mktemp("worn") / "slider.nc"
    run_study("sdof_slider", found, overrides=COARSE | POINTS, progress=False).close()
    return found


@pytest.mark.slow
def test_loops_and_responses_are_those_of_studies_that_ask_for_them(path, tmp_path):
    found = compute_worn_joint(path, tmp_path, loops=[0], response=True, progress=False)
    with xr.open_dataset(path) as result:
        point = result.isel(frequency=int(result.worn_volume.isel(cycle=-1).argmax(...)["frequency"])).squeeze().load()
    frequency = point.frequency.item()
    assert found["loops"].cycle.values.tolist() == [0.0, 8000.0]
    for name in ("loop_displacement", "loop_force"):
        # the joint without wear is the same; the worn one has another history of friction
        again, first = (each[name].isel(cycle=0).values.squeeze() for each in (found["loops"], point))
        np.testing.assert_allclose(again, first, rtol=1e-6, atol=1e-9 * float(abs(point[name]).max()))
    assert f"{frequency:g} Hz" in found["response"].attrs["title"]
    table = {"result": str(path), "frequency": frequency, "cycle": [8000.0]}
    given = COARSE | {"scene.worn": table, "axes.frequency": POINTS["axes.frequency"], "axes.scheme": "adaptive"}
    given |= {"slow_time.cycles": 0.0, "slow_time.outputs": 1}
    with run_study("sdof_slider", tmp_path / "begun.nc", overrides=given, progress=False) as begun:
        expected = begun.response_amplitude.squeeze().values
    np.testing.assert_array_equal(found["response"].response_amplitude.squeeze().values, expected)


@pytest.mark.slow
def test_the_command_draws_what_it_computes_and_says_what_is_wrong(path, tmp_path, monkeypatch, capsys):
    both = [entry for entry in contents.FIGURES if entry.name in ("frequency_response", "fretting_loops")]
    monkeypatch.setattr(contents, "FIGURES", both)
    assert main([str(path), "-o", str(tmp_path), "--loops", "0"]) == 0
    assert "worn by" in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert (tmp_path / "fretting_loops.csv").exists()
    # without the scene a sentence takes the place of the curve
    lost = tmp_path / "lost.nc"
    shutil.copy(path, lost)
    with h5py.File(lost, "r+") as file:
        text = file.attrs["study"].decode().replace('model = "sdof_slider"', 'model = "gone.h5"')
        del file.attrs["study"]
        file.attrs.create("study", text, dtype=h5py.string_dtype("utf-8"))
    for options in ([], ["--no-compute"]):
        assert main([str(lost), "-o", str(tmp_path / "lost"), *options]) == 0
        page = (tmp_path / "lost" / "index.html").read_text(encoding="utf-8")
        assert ("Without the curve of the worn joint" in page) is (not options)
    capsys.readouterr()
    for wrong in (["--loops", "7"], ["--loops", "a"]):
        assert main([str(path), "-o", str(tmp_path), *wrong]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    with pytest.raises(UserError, match="frequency"):
        compute_worn_joint(path, tmp_path, response=True, point={"frequency": "1"})
