"""What the result file holds of the scene itself."""

import math

import numpy as np
import pytest
import xarray as xr

from studies.finite_element.elimination import NotPositiveDefiniteError
from studies.finite_element.reduction import Reduction
from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.result import write as writing
from studyrunner.scene import computed
from studyrunner.scene.answers import build_scene_variables, exact_answers
from studyrunner.scene.scene import build_study_scene
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS, fake_histories
from tests.studyrunner.results import build_dataset, write_dataset
from tests.studyrunner.test_write_result import write_study

SLIDER = ("axes.frequency=[160, 60, 150]", "slow_time.outputs=3", "axes.excitation_amplitude=[10, 11]")
EXACT = "outputs.variables=['default', 'exact']"
GRID = (*SLIDER, EXACT, "axes.wear_coefficient=[1e-11, 0]", "axes.step=[10, 100]", "axes.harmonics=[1, 3]")
COARSE = ("scene.mesh=1", "axes.frequency=212", "slow_time.cycles=0", "axes.scheme=implicit")


@pytest.mark.slow
@pytest.mark.parametrize("bytes_a_slab", [3000.0])
def test_the_file_is_the_one_of_the_plain_twin(bytes_a_slab, tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "_BYTES_A_SLAB", bytes_a_slab)
    study = read_study("sdof_slider", GRID)
    of_scene = exact_answers(study)
    frequencies = read_study("two_masses", ["outputs.variables=['natural_frequency']"])
    of_scene += build_scene_variables(frequencies, build_study_scene(frequencies))
    mesh = read_study("dovetail", ["scene.mesh=1", "outputs.variables=['mesh']"])
    of_scene += build_scene_variables(mesh, build_study_scene(mesh))
    plan = build_tasks(study, FACTS.n_displacements)
    results = [result for _, result in fake_histories(plan)]
    write_study(study, results, tmp_path / "out.nc", of_scene)
    twin_set = build_dataset(study, FACTS, results, of_scene)
    write_dataset(twin_set, tmp_path / "twin.nc")
    with xr.open_dataset(tmp_path / "out.nc") as opened, xr.open_dataset(tmp_path / "twin.nc") as twin:
        assert opened.exact_worn_volume.dims[-1] == "cycle"
        assert opened.mesh_part.dtype.kind == "U"
        xr.testing.assert_identical(opened, twin)


def test_exact_answers_stand_at_their_points():
    study = read_study("sdof_slider", GRID)
    found = {scene.name: scene for scene in exact_answers(study)}
    assert set(found) == {"exact_worn_volume", "exact_response_amplitude"}
    volume, response = found["exact_worn_volume"].values, found["exact_response_amplitude"].values
    # frequency, wear coefficient, excitation amplitude; nothing depends on step, scheme, sweep, harmonics
    assert volume.shape == (3, 2, 2, 1, 1, 1, 1, 3)
    assert response.shape == (3, 2, 2, 1, 1, 1, 1, 3, 1)
    assert np.isnan(volume[1]).all()
    assert not volume[[0, 2], 1].any()
    assert (np.diff(volume[[0, 2], 0], axis=-1) > 0.0).all()
    for frequency in (0, 2):
        for amplitude in (0, 1):
            axes = {
                "frequency": study.axes.frequency[frequency],
                "excitation_amplitude": study.axes.excitation_amplitude[amplitude],
                "wear_coefficient": 1e-11,
            }
            own = [f"axes.{name}={value}" for name, value in axes.items()]
            alone = read_study("sdof_slider", [*own, "slow_time.outputs=3", EXACT])
            one, other = exact_answers(alone)
            assert np.array_equal(one.values.ravel(), volume[frequency, 0, amplitude].ravel())
            assert np.array_equal(other.values.ravel(), response[frequency, 0, amplitude].ravel())


LAWS = {
    "energy": (("wear.law=energy",), 6.16499e-10),
    "threshold": (("wear.law=threshold", "wear.threshold=50"), 1.51371e-10),
    "table": (("wear.law=table", "wear.pressure=[0.0]", "wear.depth=[0.0]", "wear.factor=[[0.5]]"), 6.16499e-10),
    "surfaces": (("wear.surfaces={support=0.5}",), 6.16499e-10),
    "worn": (("scene.worn={depth=2e-5}",), 1.021383e-9),
}
"""Changes of a study of the slider, and the volume, m3, that wears with each: 35 harmonics, 1024 samples, rtol 1e-4."""


@pytest.mark.parametrize("name", LAWS)
def test_the_exact_answer_is_that_of_the_wear_law_and_of_the_worn_start(name):
    changes, computed = LAWS[name]
    study = read_study("sdof_slider", ("axes.frequency=160", "slow_time.outputs=2", EXACT, *changes))
    volume, response = exact_answers(study)
    assert volume.values.ravel()[-1] == pytest.approx(computed, rel=5e-5)
    assert response.values.ravel()[0] == pytest.approx(1.535e-4 if name == "worn" else 1.438e-4, rel=1e-3)


def test_an_input_that_the_closed_form_does_not_know_leaves_no_exact_answer():
    for more, known in (((), True), (("scene.damping=0.1",), False)):
        study = read_study("sdof_slider", ("axes.frequency=160", "slow_time.outputs=2", EXACT, *more))
        assert all(np.isfinite(each.values).all() for each in exact_answers(study)) == known


def test_a_sector_that_spins_too_fast_is_bad_input(tmp_path, monkeypatch, capsys):
    """The nodal diameters of the study are fine, another one is not: known before anything is computed."""
    monkeypatch.chdir(tmp_path)

    def unstable(*_):
        raise NotPositiveDefiniteError(unstable=True)

    monkeypatch.setattr(Reduction, "frequencies", unstable)
    # on a busy machine the scene may take so long that it would be kept for another run
    monkeypatch.setattr(computed, "LEAST_SECONDS", math.inf)
    overrides = (*COARSE, "outputs.variables=['natural_frequency']")
    assert main(["dovetail", "-o", "out.nc", *(part for text in overrides for part in ("--set", text))]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "scene.rotation_speed = 3000: reduce it" in said[-1]
    assert list(tmp_path.iterdir()) == []
