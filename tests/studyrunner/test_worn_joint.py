"""Worn joints that are computed again, and studies in gross slip, whose pairs are laid as far as they wear."""

import math
import shutil

import h5py
import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from studies import build_scene, read_scene
from studyrunner import UserError, compute_worn_joint, read_study, run_study
from studyrunner.cli import main
from studyrunner.kinds.wear import figures
from studyrunner.points.table import points_of
from studyrunner.report import cli as report
from studyrunner.scene.answers import write_study_scene
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.room import expected_wear
from studyrunner.study.study_file import format_study
from tests.mpi.launching import options, results
from tests.studyrunner.small_studies import compute

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
    both = [entry for entry in figures.FIGURES if entry.name in ("frequency_response", "fretting_loops")]
    monkeypatch.setattr(figures, "FIGURES", both)
    assert report.main([str(path), "-o", str(tmp_path), "--loops", "0"]) == 0
    assert "worn by" in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert (tmp_path / "fretting_loops.csv").exists()
    # without the scene a sentence takes the place of the curve
    lost = tmp_path / "lost.nc"
    shutil.copy(path, lost)
    with h5py.File(lost, "r+") as file:
        text = file.attrs["study"].decode().replace('model = "sdof_slider"', 'model = "gone.h5"')
        del file.attrs["study"]
        file.attrs.create("study", text, dtype=h5py.string_dtype("utf-8"))
    for more in ([], ["--no-compute"]):
        assert report.main([str(lost), "-o", str(tmp_path / "lost"), *more]) == 0
        page = (tmp_path / "lost" / "index.html").read_text(encoding="utf-8")
        assert ("Without the curve of the worn joint" in page) is (not more)
    capsys.readouterr()
    for wrong in (["--loops", "7"], ["--loops", "a"]):
        assert report.main([str(path), "-o", str(tmp_path), *wrong]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    with pytest.raises(UserError, match="frequency"):
        compute_worn_joint(path, tmp_path, response=True, point={"frequency": "1"})


@pytest.mark.usefixtures("folder", "solver")
def test_the_worn_joint_of_a_sample_has_the_scene_of_the_sample(sliding, capsys):
    """Its pairs lie where the depths are from, and nothing is said of another scene than that of the file."""
    given = {"axes.P": [2e4, 1e4], "axes.scheme": "implicit", "wear.surfaces": {"flat": 1.0, "cylinder": 0.5}}
    drawn = {name: {"lognormal": {"factor": 1.2}} for name in ("R", "wear_coefficient")}
    scatter = {"samples": 2, **drawn, "surfaces": {"flat": {"lognormal": {"factor": 1.2}}}}
    run_study(sliding, "w.nc", overrides=given | {"scatter": scatter}, progress=False).close()
    capsys.readouterr()
    point = {"P": "10000", "sample": "1"}
    found = compute_worn_joint("w.nc", ".", loops=[0], point=point)
    assert "another scene" not in capsys.readouterr().err
    assert found["loops"].cycle.values.tolist() == [2000.0]
    own = results("w.nc").sel(P=1e4, sample=1)
    np.testing.assert_array_equal(results("worn_joint_loops.nc").contact_x, own.contact_x)
    # an axis that came later has its default, and not another value
    whole = xr.load_dataset("w.nc")
    text = whole.attrs["study"].replace("excitation_amplitude = [1.0]\n", "")
    assert text != whole.attrs["study"]
    whole.squeeze("excitation_amplitude", drop=True).assign_attrs(study=text).to_netcdf("older.nc")
    older = compute_worn_joint("older.nc", "older", loops=[0], point=point)
    xr.testing.assert_equal(older["loops"], found["loops"])
    whole.assign_attrs(study=text.replace("[axes]", "[axes]\nexcitation_amplitude = [1.0, 2.0]")).to_netcdf("other.nc")
    with pytest.raises(UserError, match="attribute study"):
        compute_worn_joint("other.nc", "other", loops=[0], point=point)


# --- room for wear ---

SLIDING = """
study = {name = "sliding"}
scene = {model = "cylinder_on_flat", stroke = 10e-6, friction_coefficient = 0.8, P = 20e3, strips = 12}
axes = {frequency = 20.0, wear_coefficient = 1e-13, sweep = "ramp"}
slow_time = {cycles = 2000, outputs = 5}
solver = {harmonics = 3, samples = 32}
"""


@pytest.fixture
def sliding(tmp_path):
    found = tmp_path / "sliding.toml"
    found.write_text(SLIDING)
    return found


def half_width(study):
    return dict(study.scene.parameters)["half_width"]


def test_all_that_is_made_of_the_study_has_the_width_that_it_shows(sliding):
    study = read_study(sliding)
    width = half_width(study)
    model = build_study_scene(study)
    assert model.contact.position[-1, 0] == pytest.approx(width * 11 / 12)
    digest = describe_scene(model).digest
    # the whole study again, also where it would wear more by now
    sliding.write_text(format_study(study))
    assert read_study(sliding) == read_study(sliding, {"scene.half_width": width})
    assert half_width(read_study(sliding, {"slow_time.cycles": 1e6})) == width
    # its scene file, and the scene in Python
    write_study_scene(study, sliding.with_name("scene.h5"), print)
    given = {key: value for key, value in study.scene.parameters if key != "friction_coefficient"}
    for again in (read_scene(sliding.with_name("scene.h5")), build_scene("cylinder_on_flat", **given)):
        assert describe_scene(again).digest == digest


@pytest.mark.parametrize(
    ("overrides", "factor"),
    [
        ({}, 1.0),
        ({"axes.wear_coefficient": [1e-14, 3e-13, 0.0]}, 3.0),
        ({"slow_time.cycles": 3000}, 1.5),
        ({"slow_time.outputs": [10, 1000]}, 0.5),
        ({"wear.law": "threshold", "wear.threshold": 1.0}, 1.0),
        ({"wear.surfaces": {"flat": 2.0, "cylinder": 3.0}, "wear.law": "energy"}, 4.0),
        ({"wear": {"law": "table", "pressure": [1e8, 1e9], "depth": [0, 1e-6], "factor": [[2, 7], [1, 3]]}}, 7.0),
    ],
)
def test_it_is_the_most_that_any_point_wears(sliding, overrides, factor):
    study = read_study(sliding, overrides)
    expected = expected_wear(study)
    assert expected.per_slip_work == pytest.approx(factor * 1e-13 * 2000, rel=1e-12)
    assert (expected.amplitude, expected.volume, expected.depth) == (1.0, math.inf, math.inf)
    # b^3 - a^3 of the segment is proportional to it
    assert half_width(study) == pytest.approx(half_width(read_study(sliding)) * factor ** (1.0 / 3.0), rel=0.08)


def test_a_scene_has_room_for_nearly_all_samples_whatever_their_number(sliding):
    scatter = {"samples": 8, "wear_coefficient": {"lognormal": {"factor": 1.5}}}
    study = read_study(sliding, {"scatter": scatter})
    assert expected_wear(study).per_slip_work == pytest.approx(1.5**3.1 * 1e-13 * 2000)
    assert half_width(study) > half_width(read_study(sliding))
    assert half_width(read_study(sliding, {"scatter": {**scatter, "samples": 1024}})) == half_width(study)
    widths = {half_width(part) for part in points_of(study).studies}
    assert widths == {half_width(study)}
    # one scene for all
    assert len(find_scenes(study).studies) == 1


def test_each_sample_with_a_scene_of_its_own_has_room_for_its_wear(sliding):
    inputs = {name: {"lognormal": {"factor": 1.5}} for name in ("P", "wear_coefficient")}
    study = read_study(sliding, {"scatter": {"samples": 8, **inputs}})
    for part in points_of(study).studies:
        own = {"scene.P": dict(part.scene.parameters)["P"]}
        alone = read_study(sliding, {**own, "axes.wear_coefficient": part.axes.wear_coefficient[0]})
        assert half_width(part) == half_width(alone)


@pytest.mark.slow
def test_a_scar_that_is_cut_off_is_a_failed_point_with_a_remedy(sliding, folder, capsys):
    assert main([str(sliding), "-o", "out.nc", *options("scene.half_width=5e-5")]) == 3
    assert "The contact goes on beyond the modelled pairs" in capsys.readouterr().out
    cut = results().squeeze()
    assert cut.outcome == Outcome.CONTACT_CUT_OFF
    assert "edge of the modelled contact" in cut.message.item()
    wide = compute(str(sliding), "out.nc").squeeze()
    assert not wide.mean_pressure.values[:, -1].any()
    assert 0.0 < float(wide.wear_depth.isel(cycle=-1).max()) < float(cut.wear_depth.isel(cycle=-1).max())
