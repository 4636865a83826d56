"""The result file: dimensions, units, attributes, and that it appears whole or not at all."""

import contextlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from studyrunner.accessor import FretwearAccessor
from studyrunner.cli import main
from studyrunner.coordinates import COORDINATES
from studyrunner.kinds.table import KINDS
from studyrunner.kinds.wear.kind import ASKED, LOOPS, OF_A_HISTORY
from studyrunner.result import write as writing
from studyrunner.result.arrays import coordinates
from studyrunner.result.provenance import describe_run
from studyrunner.result.target import Target
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import read_study
from studyrunner.system import machine
from studyrunner.user_error import StorageError
from tests.mpi.launching import options
from tests.studyrunner.fakes import FACTS, fake_completion, fake_history, plan_of, started, without_values
from tests.studyrunner.results import build_dataset, write_dataset

OVERRIDES = (
    "axes.frequency=[160.0, 150.0]",
    "axes.scheme=['implicit', 'explicit']",
    "axes.harmonics=[1, 3]",
    "slow_time.outputs=[0, 100, 1000]",
)
AXES = (*KINDS["wear"].axes, "harmonics")
SHARED = ("axes.wear_coefficient=[1e-12, 1e-11, 0]", "axes.step=[10, 100]", "axes.scheme=['adaptive', 'implicit']")
LOOP = "outputs.loops=[1]"
WEAR_RATE = "outputs.variables=['wear_rate', 'outcome']"
SHAPE = tuple({"frequency": 2, "scheme": 2, "harmonics": 2}.get(name, 1) for name in AXES)


def fake_results(*overrides):
    plan = plan_of(read_study("sdof_slider", (*OVERRIDES, *overrides)), FACTS.n_displacements)
    return [(task.points(place), fake_history(task, place=place)) for task in started(plan) for place in task.order]


def write_study(study, results, path):
    """The file of a run of the study with these results."""
    plan = plan_of(study, FACTS.n_displacements)
    completion = fake_completion(study, plan, results, Target(path).progress)
    arrays = [*coordinates(study, [FACTS], find_scenes(study))]
    with contextlib.closing(completion.store):
        return writing.write_result(study, FACTS, completion, Target(path), arrays, describe_run(study, FACTS))


def write(results, path, *overrides):
    return write_study(read_study("sdof_slider", (*OVERRIDES, *overrides)), results, path)


@pytest.fixture
def opened(tmp_path):
    write(fake_results(), tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as result:
        return result.load()


CONTRACT = {
    name: (dimensions, units)
    for dimensions, units, names in (
        (("cycle",), "m3", "worn_volume"),
        (("cycle",), "m3 per cycle", "wear_rate"),
        (("cycle", "contact"), "m", "wear_depth slip_range wear_depth_error"),
        (("cycle", "contact"), "Pa", "mean_pressure"),
        (("cycle", "contact"), "1", "open_fraction"),
        (("cycle", "response"), "m", "response_amplitude response_mean response_peak"),
        (("cycle", "response"), "rad", "response_phase"),
        (("cycle",), "1", "residual penetration tension cone_violation energy_error response_error wear_rate_error"),
        (("cycle",), "1", "worn_volume_error harmonics_used samples_used friction_use"),
        ((), "1", "cycles_to_target cycles_to_target_error"),
        ((), "1", "outcome jump_cycle newton_iterations error_estimate branch"),
        ((), "1", "last_cycle step_limit message"),
        ((), "s", "run_time"),
        ((), "Hz", "fold_frequency"),
        ((), "m", "largest_wear_depth"),
        (("cycle",), "m", "wear_depth_max wear_depth_max_error"),
        ((), "N", "slip_amplitude"),
    )
    for name in names.split()
}


def test_all_variables_with_their_dimensions_and_units(opened):
    assert set(opened.data_vars) == set(CONTRACT)
    assert AXES[:6] == ("frequency", "wear_coefficient", "excitation_amplitude", "step", "scheme", "sweep")
    for name, (dimensions, units) in CONTRACT.items():
        assert opened[name].dims == (*AXES, *dimensions)
        assert opened[name].shape[: len(AXES)] == SHAPE
        assert opened[name].attrs["units"] == units
    assert all(opened[name].attrs["long_name"] and opened[name].attrs["units"] for name in opened.variables)
    expected = {
        "frequency": [160.0, 150.0],
        "scheme": ["implicit", "explicit"],
        "sweep": ["up"],
        "cycle": [0.0, 100.0, 1000.0],
        "response": ["tip"],
        "contact_surface": ["intrados", "extrados"],
        "contact_area": [1e-4, 2e-4],
        "contact_z": [0.3, 0.6],
    }
    assert {name: opened[name].values.tolist() for name in expected} == expected
    assert opened.harmonics.dtype == opened.contact.dtype == np.int32
    assert all("_FillValue" not in opened[name].encoding for name in opened.coords)


def test_pairs_without_loops_take_no_room(tmp_path):
    results = fake_results("outputs.loops=[0, 1]"), fake_results(LOOP)
    for number, (each, asked) in enumerate(zip(results, ("outputs.loops=[0, 1]", LOOP), strict=True)):
        write(each, tmp_path / f"{number}.nc", asked)
    sizes = []
    for number in (0, 1):
        with h5py.File(tmp_path / f"{number}.nc") as file:
            sizes.append(sum(file[name].id.get_storage_size() for name in ("loop_displacement", "loop_force")))
    assert 0.4 * sizes[0] < sizes[1] < 0.6 * sizes[0]


@pytest.mark.parametrize(("overrides", "bytes_a_slab"), [((), 1e9), ((*SHARED, LOOP), 3000.0), ((WEAR_RATE,), 1.0)])
def test_the_file_is_the_one_of_the_plain_twin(overrides, bytes_a_slab, tmp_path, monkeypatch):
    """Whatever is in memory at once, and in whatever order the results came: every value, attribute and encoding."""
    monkeypatch.setattr(writing, "_BYTES_A_SLAB", bytes_a_slab)
    results = fake_results(*overrides)
    results[1] = (results[1][0], without_values(results[1][1], 6))
    shuffled = [results[place] for place in np.random.default_rng(3).permutation(len(results))]
    write(shuffled, tmp_path / "out.nc", *overrides)
    study = read_study("sdof_slider", (*OVERRIDES, *overrides))
    write_dataset(build_dataset(study, FACTS, results), tmp_path / "twin.nc")
    with xr.open_dataset(tmp_path / "out.nc") as opened, xr.open_dataset(tmp_path / "twin.nc") as twin:
        xr.testing.assert_identical(opened, twin)
        assert list(opened.variables) == list(twin.variables)
        own = ("source", "chunksizes", "preferred_chunks", "contiguous") if bytes_a_slab < 1e9 else ("source",)
        for name in twin.variables:
            expected, found = ({k: v for k, v in at[name].encoding.items() if k not in own} for at in (twin, opened))
            np.testing.assert_equal(found, expected)
        assert opened.encoding["unlimited_dims"] == twin.encoding["unlimited_dims"]


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "out.nc"
    path.write_text("an earlier result", encoding="utf-8")

    replace_file = os.replace

    def fail(source, target):
        if target == path:
            raise OSError("disk full")
        replace_file(source, target)

    monkeypatch.setattr(machine.os, "replace", fail)
    with pytest.raises(StorageError, match="disk full"):
        write(fake_results(), path)
    assert path.read_text(encoding="utf-8") == "an earlier result"
    assert sorted(tmp_path.iterdir()) == [path, Target(path).progress]


def test_the_examples_of_readme_and_pages_run(tmp_path, monkeypatch, capsys):
    pages = ("README.md", "studyrunner/RESULT_FILE.md", "studyrunner/REPORT.md")
    texts = [Path(__file__).parents[2].joinpath(page).read_text(encoding="utf-8") for page in pages]
    (short,), (example,), (of_accessor,) = (re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL) for text in texts)
    named = set(re.findall(r"\.fretwear\.(\w+)", of_accessor))
    assert {"response", "flank"} <= named <= set(dir(FretwearAccessor))
    study = read_study("dovetail", ["axes.frequency=[1, 2, 3]", "outputs.loops=[]"])
    plan = plan_of(study, FACTS.n_displacements)
    write_study(study, [(task.points(0), fake_history(task)) for task in started(plan)], tmp_path / "dovetail.nc")
    monkeypatch.chdir(tmp_path)
    for code, said in ((short, "frequency\n1.0 "), (example, " of 9\n")):
        exec(compile(code, "page", "exec"), {})
        assert said in capsys.readouterr().out


def test_readme_and_ci_have_the_same_test_command():
    root = Path(__file__).parents[2]
    readme, script = (root.joinpath(name).read_text(encoding="utf-8") for name in ("README.md", ".ci/run"))
    (command,) = [line for line in readme.splitlines() if line.endswith("-m pytest -n auto")]
    assert [part for part in command.split(" && ") if part not in script] == []


# --- as an archive reads it ---

CHECK = """
import json, socket, sys
from compliance_checker.suite import CheckSuite

def refuse(*_, **__):
    raise OSError("no network in tests")

socket.socket.connect = socket.getaddrinfo = refuse
CheckSuite.load_all_available_checkers()
suite, found, broken, n_checks = CheckSuite(), [], {}, 0
for checker, (pending, errors) in suite.run_all(suite.load_dataset(sys.argv[1]), ["cf:1.11", "acdd:1.3"]).items():
    broken |= {name: str(error) for name, (error, *_) in errors.items()}
    while pending:
        result = pending.pop()
        pending.extend(result.children)
        n_checks += 1
        passed, wanted = result.value if isinstance(result.value, tuple) else (bool(result.value), True)
        if passed != wanted:
            found += [(checker, result.weight, str(result.name), message) for message in result.msgs or ()]
print(json.dumps([n_checks, found, broken]))
"""
"""A process of its own: the checker is not free of warnings, and it would ask the network for tables that it lacks."""

EVERYTHING = (
    *("scene.mesh=1", "scene.stuck_modes=5", "scene.retention_stiffness=1e7", "axes.frequency=[211.5, 212.0]"),
    *("axes.scheme=['implicit', 'adaptive']", "axes.harmonics=[1, 2]", "slow_time.cycles=500", "slow_time.outputs=3"),
    *("outputs.variables=['default', 'natural_frequency']", "outputs.loops=[0, 3]", "outputs.scene=true"),
)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result with all that one can have: loops, mesh, group of the scene, text, a point that failed."""
    path = tmp_path_factory.mktemp("compliance") / "everything.nc"
    assert main(["dovetail", "-o", str(path), *options(*EVERYTHING)]) in (0, 3)
    with netCDF4.Dataset(path, "r+") as file:
        # as it is where a computation breaks off
        first = (0,) * file["outcome"].ndim
        file["outcome"][first], file["message"][first] = 11, "ZeroDivisionError: division by zero"
    return path


@pytest.mark.slow
def test_compliance_checker_passes(result):
    """CF, and of ACDD what is highly recommended: the rest is for whoever publishes the file."""
    done = subprocess.run([sys.executable, "-c", CHECK, str(result)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    n_checks, complaints, broken = json.loads(done.stdout)
    assert n_checks > 50
    left = []
    for checker, weight, name, message in complaints:
        # the table of standard names knows geophysics: it has no name for any of these, and inventing one breaks CF
        of_names = checker == "acdd:1.3" and (weight < 3 or message == "standard_name")
        # a fault of the checker: UDUNITS converts 1/Pa to bar, which is a height then and would stand on the right
        height = (checker, weight, name) == ("cf:1.11", 2, "§2.4 Dimensions") and "wear_coefficient (Z)" in message
        if not (of_names or height):
            left.append((checker, weight, name, message))
    assert left == []
    # another fault: words of `scheme`, `sweep`, `response` and `component` are subtracted from each other
    assert set(broken) <= {"check_coordinate_variables_strict_monotonicity"}
    assert all("'str'" in message for message in broken.values())


def test_the_header_reads_like_documentation(result):
    known = {**ASKED, **OF_A_HISTORY, **LOOPS, **COORDINATES}
    with netCDF4.Dataset(result) as file:
        assert {"loop_force", "mesh_quad", "natural_frequency", "message", "mode", "phase"} <= set(file.variables)
        assert all(variable.units and variable.coverage_content_type for variable in file.variables.values())
        commented = [name for name in file.variables if name in known and known[name].comment]
        assert {"wear_rate", "loop_force", "jump_cycle", "contact_area"} <= set(commented)
        assert all(file[name].comment.startswith(known[name].comment) for name in commented)
        outcome = file["outcome"]
        assert len(outcome.flag_values) == len(outcome.flag_meanings.split()) == len(outcome.sentences.split("\n"))
        assert all(
            word in file.versions for word in ("fretwear", "numpy", "scipy", "numba", "h5py", "netCDF4", "Python")
        )
        assert [len(each) for each in (file.scene_sha256, file.solver_digest, file.id)] == [64, 32, 32]
        assert file["scene"].comment
