"""Notebooks run from nothing, quietly and quickly, and hold what they say and draw, as a forge shows it."""

import ast
import re
import resource

import nbformat
import pytest

from studyrunner.cli import main
from tests.benchmarks.notebooks import LANGUAGE, NOTEBOOKS, execute, settle

SMALL = [
    *("dovetail", "scene.mesh=1", 'axes.sweep=["up", "down"]', "axes.frequency=[209.0, 212.5]"),
    *("slow_time.cycles=3000", "slow_time.outputs=5", "solver.harmonics=3", "solver.samples=64"),
    "outputs.loops=[0, 3]",
]
FIGURES = {
    "read_a_result": 2,
    "frf_before_and_after": 2,
    "wear_maps": 3,
    "explicit_and_implicit": 2,
    "error_against_run_time": 1,
    "several_files": 1,
    "trends": 4,
    "python_api": 3,
    "scatter": 3,
    "modes": 3,
    "mission": 3,
    "followed_resonance": 2,
}
LARGEST = 150_000  # bytes of a file


@pytest.fixture(scope="session")
def small_result(tmp_path_factory):
    """Path of a small result of the bundled study."""
    path = tmp_path_factory.mktemp("result") / "small.nc"
    study, *changes = SMALL
    assert main([study, *(word for change in changes for word in ("--set", change)), "-o", str(path)]) == 0
    return path


def run(path, folder, variables):
    here = folder / "here"
    here.mkdir(parents=True)
    return execute(path, here, variables).cells


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


def count_figures(cells):
    return sum("image/png" in output.get("data", {}) for output in outputs(cells))


def written_as_warning(cells):
    return [output.text for output in outputs(cells) if output.output_type == "stream" and output.name == "stderr"]


def tells(source):
    """Whether a cell is to show something: it ends with a value, prints, or draws."""
    last = ast.parse(source).body[-1]
    sets = "rcParams" in ast.unparse(last)
    shows = isinstance(last, ast.Expr) and not source.rstrip().endswith(";") and not sets
    return shows or "print(" in source or "subplots(" in source


def children_seconds():
    """Time of processors that processes of this one have taken, s: it does not depend on what else the machine does."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.slow
def test_a_notebook_runs_without_a_warning_and_draws_its_figures(small_result, tmp_path):
    """One that reads a result; `python -m tests.benchmarks.notebooks` runs all of them."""
    (path,) = [path for path in NOTEBOOKS if path.stem == "wear_maps"]
    begin = children_seconds()
    cells = run(path, tmp_path, {"RESULT": str(small_result)})
    assert children_seconds() - begin < 120.0
    assert not written_as_warning(cells)
    assert count_figures(cells) == FIGURES[path.stem]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_holds_its_outputs_and_nothing_of_the_machine(path):
    assert path.stat().st_size < LARGEST
    notebook = nbformat.read(path, as_version=nbformat.NO_CONVERT)
    nbformat.validate(notebook)
    assert dict(notebook.metadata.language_info) == LANGUAGE
    assert "run-study " in notebook.cells[0].source
    code = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in code] == list(range(1, len(code) + 1))
    for cell in code:
        assert bool(cell.outputs) == tells(cell.source), cell.source
    assert not written_as_warning(code)
    assert count_figures(code) == FIGURES[path.stem]
    # settling changes nothing any more
    assert settle(nbformat.read(path, as_version=4)) == notebook
    told = [output.get("text") or "".join(map(str, output.data.values())) for output in outputs(code)]
    assert not re.search(r"(?<![\w.])/(tmp|home|root|work|usr|Users)\b|\bat 0x", "\n".join(told))
