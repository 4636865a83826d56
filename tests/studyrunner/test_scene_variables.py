"""What the result file holds of the scene itself."""

import contextlib
import math

import numpy as np
import pytest
import xarray as xr

from studies.finite_element.joint.reduction import GluedStructureError, Reduction
from studyrunner.cli import main
from studyrunner.netcdf import gather
from studyrunner.netcdf.output import progress_file
from studyrunner.plan.planning import build_tasks
from studyrunner.scene import computed
from studyrunner.scene.scene import build_study_scene
from studyrunner.scene.scene_variables import exact_answers
from studyrunner.scene.variables import build_scene_variables
from studyrunner.study.study_file import read_study
from tests.studyrunner.dataset_twin import build_dataset, write_dataset
from tests.studyrunner.fakes import FACTS, fake_completion, fake_histories

SLIDER = ("axes.frequency=[160, 60, 150]", "slow_time.outputs=3", "axes.excitation_amplitude=[10, 11]")
EXACT = "outputs.variables=['default', 'exact']"
GRID = (*SLIDER, EXACT, "axes.wear_coefficient=[1e-11, 0]", "axes.step=[10, 100]", "axes.harmonics=[1, 3]")
COARSE = ("scene.mesh=1", "axes.frequency=212", "slow_time.cycles=0", "axes.scheme=implicit")


@pytest.mark.slow
@pytest.mark.parametrize("bytes_a_slab", [3000.0])
def test_the_file_is_the_one_of_the_plain_twin(bytes_a_slab, tmp_path, monkeypatch):
    monkeypatch.setattr(gather, "_BYTES_A_SLAB", bytes_a_slab)
    study = read_study("sdof_slider", GRID)
    of_scene = exact_answers(study)
    frequencies = read_study("two_masses", ["outputs.variables=['natural_frequency']"])
    of_scene += build_scene_variables(frequencies, build_study_scene(frequencies))
    mesh = read_study("dovetail", ["scene.mesh=1", "outputs.variables=['mesh']"])
    of_scene += build_scene_variables(mesh, build_study_scene(mesh))
    plan = build_tasks(study, FACTS.n_displacements)
    results = [result for _, result in fake_histories(plan)]
    completion = fake_completion(study, plan, results, progress_file(tmp_path / "out.nc"))
    with contextlib.closing(completion.store):
        gathered = gather.gather(study, FACTS, completion, tmp_path / "out.nc", of_scene)
    twin_set = build_dataset(study, FACTS, results, gathered.certificates, of_scene)
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


def test_a_sector_that_spins_too_fast_is_bad_input(tmp_path, monkeypatch, capsys):
    """The nodal diameters of the study are fine, another one is not: known before anything is computed."""
    monkeypatch.chdir(tmp_path)

    def unstable(*_):
        raise GluedStructureError(unstable=True)

    monkeypatch.setattr(Reduction, "frequencies", unstable)
    # on a busy machine the scene may take so long that it would be kept for another run
    monkeypatch.setattr(computed, "LEAST_SECONDS", math.inf)
    overrides = (*COARSE, "outputs.variables=['natural_frequency']")
    assert main(["dovetail", "-o", "out.nc", *(part for text in overrides for part in ("--set", text))]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "scene.rotation_speed = 3000: reduce it" in said[-1]
    assert list(tmp_path.iterdir()) == []
