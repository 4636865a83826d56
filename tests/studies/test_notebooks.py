"""Notebooks run from nothing, quietly, and hold what they say and draw, as a forge shows it."""

import ast
import re

import nbformat
import pytest

from studyrunner.cli import main
from tests.benchmarks.notebooks import LANGUAGE, NOTEBOOKS, execute, settle

SMALL = [
    *("scene.mesh=1", 'axes.sweep=["up", "down"]', "axes.frequency=[209.0, 212.5]", "outputs.loops=[0, 3]"),
    *("slow_time.cycles=3000", "slow_time.outputs=5", "solver.harmonics=3", "solver.samples=64"),
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


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


def check_outputs(cells, name):
    """All figures and no warning."""
    found = outputs(cells)
    assert not [each.text for each in found if each.output_type == "stream" and each.name == "stderr"]
    assert sum("image/png" in each.get("data", {}) for each in found) == FIGURES[name]


def shows(source):
    """Whether a cell is to show something: it ends with a value, prints, or draws."""
    last = ast.parse(source).body[-1]
    value = isinstance(last, ast.Expr) and not source.rstrip().endswith(";") and "rcParams" not in ast.unparse(last)
    return value or "print(" in source or "subplots(" in source


@pytest.mark.slow
def test_a_notebook_runs_without_a_warning_and_draws_its_figures(tmp_path):
    """One that reads a result; `python -m tests.benchmarks.notebooks` runs all of them."""
    result, here = tmp_path / "small.nc", tmp_path / "here"
    assert main(["dovetail", *(word for change in SMALL for word in ("--set", change)), "-o", str(result)]) == 0
    here.mkdir()
    (path,) = [path for path in NOTEBOOKS if path.stem == "wear_maps"]
    check_outputs(execute(path, here, {"RESULT": str(result)}).cells, path.stem)


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
        assert bool(cell.outputs) == shows(cell.source), cell.source
    check_outputs(code, path.stem)
    # settling changes nothing any more
    assert settle(nbformat.read(path, as_version=4)) == notebook
    said = [output.get("text") or "".join(map(str, output.data.values())) for output in outputs(code)]
    assert not re.search(r"(?<![\w.])/(tmp|home|root|work|usr|Users)\b|\bat 0x", "\n".join(said))
