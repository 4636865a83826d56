"""The result file as an archive reads it: compliance-checker, and a header that reads like documentation."""

import json
import subprocess
import sys
from pathlib import Path

import netCDF4
import numpy as np
import pytest

from studyrunner.cli import main
from studyrunner.coordinates import COORDINATES
from studyrunner.variables import ASKED, LOOPS, OF_A_HISTORY, USUAL
from tests.mpi.launching import options

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

STUDY = """
[study]
name = "everything"
[scene]
model = "scene.h5"
friction_coefficient = 0.5
[axes]
frequency = [211.5, 212.0]
wear_coefficient = 1e-11
excitation_amplitude = 0.5
scheme = ["implicit", "adaptive"]
sweep = "up"
harmonics = [1, 2]
[slow_time]
cycles = 500
outputs = 3
[outputs]
variables = ["default", "natural_frequency"]
loops = [0, 3]
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result with all that one can have: loops, mesh, group of the scene, text, a point that failed."""
    folder = tmp_path_factory.mktemp("compliance")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        coarse = options("scene.mesh=1", "scene.stuck_modes=5", "scene.retention_stiffness=1e7")
        assert main(["dovetail", "--write-scene", "scene.h5", *coarse]) == 0
        Path("everything.toml").write_text(STUDY, encoding="utf-8")
        assert main(["everything.toml"]) in (0, 3)
        with netCDF4.Dataset("everything.nc", "r+") as file:
            # as it is where a computation breaks off
            file["outcome"][0, 0, 0, 0, 0, 0, 0] = 11
            file["message"][0, 0, 0, 0, 0, 0, 0] = "ZeroDivisionError: division by zero"
    return folder / "everything.nc"


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
        for name in (*USUAL, *LOOPS, "jump_cycle", "run_time", "contact_area", "phase", "wear_coefficient"):
            assert known[name].comment in getattr(file[name], "comment", ""), name
        outcome = file["outcome"]
        n_flags = len(outcome.flag_values)
        assert n_flags == len(outcome.flag_meanings.split()) == len(outcome.sentences.split("\n"))
        assert set(np.unique(outcome[:])) <= set(outcome.flag_values.tolist())
        for text, words in (
            (file.comment, ("positive when the pair closes", "compression", "Re(X exp(i omega t))")),
            (file.summary, ("scene.h5 with", "frequency 211.5 to 212 (2 values)", "scheme implicit, adaptive")),
            (file.versions, ("fretwear", "numpy", "scipy", "numba", "h5py", "netCDF4", "Python")),
        ):
            assert all(word in text for word in words)
        assert [len(each) for each in (file.scene_sha256, file.solver_digest, file.id)] == [64, 32, 32]
        assert file["scene"].comment
