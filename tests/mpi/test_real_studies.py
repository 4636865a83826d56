"""Studies with the solver itself on several ranks, killed and gone on: the same result as in one process."""

import contextlib
import os
import signal

import pytest
import xarray as xr

from tests.mpi.launching import count_entries, results, run_here, run_to_end

SCENES = (
    "sdof_slider",
    *("--set", "axes.frequency=160"),
    *("--set", "axes.scheme=implicit"),
    *("--set", "axes.stiffness=[1.6e5, 1.65e5, 1.7e5]"),
    *("--set", "scatter={samples = 2, friction_coefficient = {normal = {std = 0.03}}, mass = {normal = {std = 1e-3}}}"),
    *("--set", "solver.harmonics=3"),
    *("--set", "solver.samples=32"),
    *("--set", "slow_time.cycles=2000"),
    *("--set", "slow_time.outputs=3"),
)
"""Six scenes, of which each rank holds two at most."""

ROOT = (
    "dovetail",
    *("--set", "axes.frequency=212.5"),
    *("--set", "axes.scheme=['explicit', 'adaptive']"),
    *("--set", "scene.mesh=1"),
    *("--set", "solver.harmonics=3"),
    *("--set", "solver.samples=64"),
    *("--set", "slow_time.cycles=3000"),
    *("--set", "slow_time.outputs=3"),
    *("--set", "outputs.loops=[0, 5]"),
)
MODES = """
[study]
name = "modes"
[scene]
model = "sdof_slider"
[axes]
modal_amplitude = {start = 2e-5, stop = 1e-3, num = 10, spacing = "log"}
sweep = "down"
friction_coefficient = [0.4, 0.6]
"""
MISSIONS = """
[study]
name = "missions"
[scene]
model = "sdof_slider"
normal_stiffness = 0.0
[axes]
frequency = 160
wear_coefficient = 1e-11
damping = [0.0, 0.5]
[slow_time]
missions = 1
outputs = 2
[solver]
harmonics = 3
samples = 64
rtol = 0.1
[[mission]]
name = "hard"
excitation_amplitude = 14.0
cycles = 3000
[[mission]]
name = "heavy"
normal_load = 12.0
excitation_amplitude = 14.0
cycles = 2000
"""


@pytest.mark.parametrize(
    ("study", "kills"),
    [
        # when some of the scenes are built, then when some of the histories are there
        (SCENES, [("computed", 0, 1), ("result", 0, 0)]),
        (MODES, [("result", 2, 1)]),
        # two points with two scenes each: a rank gets both models of a mission with its task
        (MISSIONS, []),
        (ROOT, []),
    ],
)
def test_a_study_ends_with_the_result_of_one_process(study, kills, tmp_path):
    """On two ranks; after kills on three, of which one has nothing to do. kills: (kind, entries to wait for, rank)."""
    if isinstance(study, str):
        (tmp_path / "study.toml").write_text(study, encoding="utf-8")
        study = [str(tmp_path / "study.toml")]
    (tmp_path / "alone").mkdir()
    expected = run_here(study, tmp_path / "alone")
    command = ["-m", "studyrunner.cli", *study, "-o", "out.nc"]
    for kind, n_entries, rank in kills:

        def kill(running, kind=kind, n_entries=n_entries, rank=rank):
            assert running.reaches(lambda: count_entries(kind, tmp_path / "out.nc") > n_entries), running.said
            with contextlib.suppress(ProcessLookupError, KeyError):
                os.kill(running.ranks()[rank], signal.SIGKILL)

        assert run_to_end(2, command, tmp_path, disturb=kill).status != 0
        assert count_entries(kind, tmp_path / "out.nc") > n_entries
    ended = run_to_end(3 if kills else 2, command, tmp_path)
    assert ended.status == 0, ended.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), expected)
    if study is SCENES:
        assert expected.worn_volume.sizes["stiffness"] * expected.worn_volume.sizes["sample"] == 6
    if study is ROOT:
        assert expected.loop_force.notnull().any(["cycle", "phase", "component"]).sum() == 2 * 2
        assert "mesh_quad" in expected
    assert "worn_volume" not in expected or (expected.worn_volume.max() > 0.0)
