"""What the last lines of a run say of the mesh."""

import numpy as np
import pytest

from studyrunner.study.study_file import read_study
from studyrunner.summary.mesh_change import MeshChange, extrapolate
from tests.studyrunner.results_of import results_of, told

GRID = ("axes.frequency=[211.5, 212]", "axes.scheme=adaptive")


def said(meshes, volumes, error=1e-3):
    """The rows of a study of the dovetail; volumes, mm3, of both frequencies by mesh."""
    study = read_study("dovetail", (*GRID, *([f"axes.mesh={meshes}"] if meshes else [])))
    axes, n = list(study.dimensions), len(study.cycles_kept)

    def volume(point):
        mesh = study.dimensions["mesh"][point[axes.index("mesh")]] if meshes else 2.0
        return 1e-9 * volumes[float(mesh)][point[axes.index("frequency")]] * np.linspace(0.0, 1.0, n)

    results = results_of(study, worn_volume=volume, error_estimate=lambda _: error, outcome=lambda _: 0)
    return told(MeshChange.rows, lambda: MeshChange(study), study, results)


def test_a_scene_with_a_mesh_says_what_its_errors_are_not():
    ((label, text),) = said("", {2.0: [1.0, 1.0]})
    assert label == "mesh"
    assert text.startswith("errors are those of the reduced model; another mesh moves worn volumes")
    assert said("[2]", {2.0: [1.0, 1.0]}) == [(label, text)]
    assert MeshChange(read_study("sdof_slider", ())).rows() == []
    assert MeshChange(read_study("dovetail", ("slow_time.cycles=0",))).rows() == []


def test_the_two_finest_meshes_are_compared():
    ((_, text),) = said("[2, 3]", {2.0: [2.0, 1.0], 3.0: [1.0, 1.1]})
    assert text.startswith("the two finest differ by 30 % in the median, at most 50 % at 211.5 Hz; three meshes show")
    assert said("[2, 3]", {2.0: [0.0, 0.0], 3.0: [0.0, 0.0]}) == [("mesh", "no point wears with two meshes")]


def test_meshes_that_converge_are_extrapolated():
    """V = 1 + 0.5 / mesh^2 at the second frequency; the first one goes to and fro."""
    converging = {mesh: 1.0 + 0.5 / mesh**2 for mesh in (1.0, 2.0, 4.0)}
    both = {mesh: [2.0 + (-0.1) ** mesh, volume] for mesh, volume in converging.items()}
    ((_, text),) = said("[4, 1, 2]", both)
    assert text.endswith("; 1 of 2 points converge at 212 Hz: 1 mm3, order 2.0")
    ((_, text),) = said("[1, 2, 4]", both, error=0.1)
    assert "; no point converges: compare frequencies at one distance to the resonance" in text


@pytest.mark.parametrize("order", [0.7, 1.0, 3.5])
def test_limit_and_order_are_found(order):
    volumes = [(mesh, (2.0 - mesh**-order, 1e-4)) for mesh in (2.0, 3.0, 4.0)]
    limit, found = extrapolate(volumes) or (0.0, 0.0)
    assert limit == pytest.approx(2.0, rel=1e-9)
    assert found == pytest.approx(order, rel=1e-9)
    assert extrapolate(volumes[:2]) is None
    # apart by more than they fall, and by less than their errors
    assert extrapolate([(2.0, (1.0, 0.0)), (3.0, (2.0, 0.0)), (4.0, (4.0, 0.0))]) is None
    assert extrapolate([(mesh, (value, 0.5)) for mesh, (value, _) in volumes]) is None
