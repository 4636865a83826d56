"""Every bundled study runs, at a small size, and shows what it is there to show; `blade_root` on its page."""

import hashlib
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import studyrunner
from solver.outcome import COMPLETE, Outcome
from studyrunner import read_study, run_study
from studyrunner.cli import main
from studyrunner.study.study_file import bundled_studies, format_study
from studyrunner.summary.answer import summary
from tests.benchmarks.pictures import FOLDER, GALLERY, NAMES, NUMBERS
from tests.mpi.launching import options, results
from tests.studyrunner.small_studies import compute

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]

SMALL = {
    "bolted_beam": "axes.modal_amplitude=[1e-5,3e-5]",
    "cylinder_on_flat": "scene.strips=24 solver.harmonics=3 solver.samples=64",
    "sphere_on_flat": "scene.patches=4 slow_time.cycles=1e4 slow_time.outputs=3 solver.harmonics=3 solver.samples=64",
    "damper": "axes.nodal_diameter=8 slow_time.cycles=10000 slow_time.outputs=3",
    "dovetail": "scene.mesh=1 axes.frequency=[207.0,212.5] slow_time.cycles=3000 slow_time.outputs=4"
    " solver.harmonics=3 solver.samples=64",
    "extremes": "axes.frequency=212.86 axes.wear_coefficient=[1.1e-14,1.1e-6] axes.step=1000 slow_time.cycles=20"
    " slow_time.outputs=3 solver.harmonics=3 solver.samples=64",
    "mission": "slow_time.missions=1 slow_time.outputs=2 solver.harmonics=3 solver.samples=64",
    "modes": "axes.modal_amplitude=[1e-4,2e-4]",
    "running_in": "slow_time.cycles=20000 slow_time.outputs=[0,2000,5000,20000] solver.harmonics=3 solver.samples=64",
    "scatter": "scatter.samples=2 scene.mesh=1 axes.frequency=212.45 slow_time.cycles=3000 slow_time.outputs=3"
    " solver.harmonics=3 solver.samples=64",
    "sdof_slider": "axes.frequency=160.0 slow_time.cycles=4000 slow_time.outputs=5",
    "shrouded": "axes.nodal_diameter=[2,4] slow_time.cycles=10000 slow_time.outputs=3 solver.harmonics=3"
    " solver.samples=64",
    "two_masses": "axes.frequency=0.0954929658551372",
    "vibro_impact": "axes.frequency=[0.17,0.19,0.21,0.22]",
    "work_precision": "scene.mesh=1 axes.frequency=212.86 axes.step=[1000,2000] axes.harmonics=5 axes.samples=64"
    " slow_time.cycles=4000 slow_time.outputs=3",
    "work_precision_slider": "axes.frequency=160.0 axes.step=[2500,10000] axes.harmonics=[1,5] axes.samples=64",
}


def wears_near_its_resonance_only(result):
    worn = result.worn_volume.isel(cycle=-1).squeeze()
    beside, near = worn.sel(frequency=207.0), worn.sel(frequency=212.5)
    assert (near > 1e-12).all()
    assert (beside < 1e-6 * near).all()


def rises_first_and_falls_later(result):
    first, *_, highest, last = result.excitation_frequency.values.ravel()
    assert first < last < highest - 0.1


def softens_and_is_damped_where_it_slips(result):
    (sticks, slips), damping = result.natural_frequency.values.ravel(), result.damping_ratio.values.ravel()
    assert slips < sticks - 0.5
    # the loss factor alone while all pairs stick
    assert damping[0] < 5e-4 < 3e-3 < damping[1]


def has_two_branches(result):
    response = result.response_amplitude.squeeze()
    assert (response.sel(sweep="up") > 1.3 * response.sel(sweep="down")).any()


def agrees_better_with_smaller_steps(result):
    worn = result.worn_volume.isel(cycle=-1).sel(harmonics=5).squeeze()
    assert (worn.sel(scheme="adaptive") == worn.sel(scheme="adaptive").isel(step=0)).all()
    for scheme in ("implicit", "explicit"):
        fine, coarse = abs(worn.sel(scheme=scheme) - worn.sel(scheme="adaptive"))
        assert fine < 0.7 * coarse


def wears_in_each_sample_another_volume(result):
    worn = result.worn_volume.isel(cycle=-1).squeeze()
    assert len(set(worn.values.tolist())) == result.sizes["sample"] == 2
    assert (result.sample_gap.std("sample") > 0.0).all()


def resonates_lower_the_more_it_is_worn(result):
    lower = -result.natural_frequency.diff("cycle")
    assert (lower > result.natural_frequency_error.isel(cycle=slice(1, None))).all()
    # what is worn a little slips where the new joint sticks
    first = result.damping_ratio.sel(modal_amplitude=2e-4).squeeze()
    assert first.sel(cycle=1e4) > 2.0 * first.sel(cycle=[0.0, 1e5]).max()


def wears_in_run_up_and_dwells(result):
    worn = result.block_worn_volume.isel(mission=-1).squeeze()
    assert (worn.sel(block=["run-up", "climb", "cruise"]) > 0.1 * worn.sum()).all()
    assert worn.sel(block="coast-down") < 1e-3 * worn.sum()


def resonates_at_each_nodal_diameter(result):
    resonance = result.excitation_frequency.isel(cycle=0).squeeze()
    assert resonance.sel(nodal_diameter=4) > 1.2 * resonance.sel(nodal_diameter=2)
    assert (result.worn_volume.isel(cycle=-1) > 0.0).all()


def resonates_between_a_free_and_a_stuck_wedge(result):
    assert (result.excitation_frequency < result.stuck_frequency).all()
    assert (result.worn_volume.isel(cycle=-1) > 0.0).all()


SHOWN = {
    "bolted_beam": softens_and_is_damped_where_it_slips,
    "scatter": wears_in_each_sample_another_volume,
    "mission": wears_in_run_up_and_dwells,
    "modes": resonates_lower_the_more_it_is_worn,
    "dovetail": wears_near_its_resonance_only,
    "running_in": rises_first_and_falls_later,
    "damper": resonates_between_a_free_and_a_stuck_wedge,
    "shrouded": resonates_at_each_nodal_diameter,
    "vibro_impact": has_two_branches,
    "work_precision": agrees_better_with_smaller_steps,
    "work_precision_slider": agrees_better_with_smaller_steps,
}
"""What a study is there to show."""


@pytest.mark.parametrize("name", sorted({*bundled_studies()} - {"extremes", "blade_root"}))
def test_every_point_of_a_bundled_study_is_computed_and_shows_it(name):
    result = compute(name, f"{name}.nc", *SMALL[name].split())
    # with so few harmonics a point may be inaccurate
    assert result.outcome.isin([Outcome.CONVERGED, Outcome.INACCURATE]).all()
    assert np.isfinite(result.response_amplitude).all()
    if name in SHOWN:
        SHOWN[name](result)


def test_every_point_of_the_extremes_is_whole_or_says_why_not():
    assert main(["extremes", "-o", "extremes.nc", *options(*SMALL["extremes"].split())]) in (0, 3)
    result = results("extremes.nc")
    whole = result.last_cycle == result.cycle[-1]
    # a point may fail in its last state as well, by its certificate
    failed = ~result.outcome.isin(list(COMPLETE))
    assert (whole | failed).all()
    assert not failed.sel(excitation_amplitude=[5e-5, 0.5], wear_coefficient=1.1e-14).any()
    computed = result.cycle <= result.last_cycle
    for name in ("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "slip_range"):
        others = [dimension for dimension in result[name].dims if dimension not in computed.dims]
        assert (result[name].notnull().all(others) == computed).all(), name
        assert (result[name].isnull().all(others) == ~computed).all(), name
    assert (result.wear_depth.isel(cycle=0).fillna(0.0) == 0.0).all()
    assert (result.wear_depth.diff("cycle").fillna(0.0) >= 0.0).all()
    assert summary(result).n_points == result.outcome.size


# --- the pictures of the other studies ---


def test_each_bundled_study_has_a_small_picture_on_the_page_that_lists_them():
    page = (Path(studyrunner.__file__).parent / "FIRST_JOB.md").read_text(encoding="utf-8")
    own = {
        "dovetail": "worn_root",
        "running_in": "running_in_frequency",
        **dict.fromkeys(("work_precision", "work_precision_slider"), "error_against_time"),
    }
    own |= {study: f"study_{study}" for study in GALLERY}
    assert set(own) == set(bundled_studies())
    for study, name in own.items():
        assert f"`{study}`" in page
        assert f"pictures/{name}.png)" in page
        assert (FOLDER / f"{name}.png").stat().st_size < (60_000 if study in GALLERY else 100_000)


# --- the pictures of the dovetail, and the numbers written down with them ---

RECOMPUTED = 211.0  # Hz; beside the resonance, which takes longer


@pytest.fixture(scope="module")
def stored():
    return dict(json.loads((FOLDER / NUMBERS).read_text(encoding="utf-8")))


def test_figures_of_the_bundled_study_are_all_written_down(stored):
    assert set(stored["figures"]) == set(NAMES)
    for name, digest in stored["pictures"].items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


def test_pictures_are_of_the_bundled_study_as_it_is(stored):
    """What a study has been given since, with a default, changes nothing; outputs are not what is computed."""
    now, then = tomllib.loads(format_study(read_study("dovetail"))), tomllib.loads(stored["study"])
    for table in set(then) - {"outputs"}:
        assert {key: now[table].get(key) for key in then[table]} == then[table], f"run {NUMBERS} again: {table} differs"


def test_a_point_computed_anew_agrees_within_the_errors(stored, tmp_path):
    changes = {
        "axes.frequency": [RECOMPUTED],
        "axes.scheme": "adaptive",
        "outputs.variables": ["worn_volume", "response_amplitude", "response_error"],
        "outputs.loops": [],
    }
    with run_study("dovetail", tmp_path / "again.nc", overrides=changes, progress=False) as result:
        point = result.squeeze(drop=True).load()
    final, unworn = (stored["figures"][name]["panels"][0] for name in ("final_worn_volume", "frequency_response"))
    # the new joint stands first
    lines = final["lines"]["adaptive scheme"], next(iter(unworn["lines"].values()))
    worn, amplitude = (dict(zip(x, y, strict=True))[RECOMPUTED] for x, y in lines)
    # of the bars at this frequency, that of the scheme is in the middle of its volume
    (own,) = [
        0.5 * (high - low)
        for at, low, high in final["bars"]
        if at == RECOMPUTED and low < worn < high and abs(0.5 * (low + high) - worn) < 1e-5 * worn
    ]
    volume, moved = 1e9 * point.worn_volume[-1].item(), 1e3 * point.response_amplitude[0].item()
    assert abs(volume - worn) <= own + volume * point.error_estimate.item()
    assert abs(moved - amplitude) <= 2.0 * point.response_error[0].item() * moved
