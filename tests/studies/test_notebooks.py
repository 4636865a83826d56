"""The notebooks run on small studies, quietly and quickly, and read nothing but result files."""

from __future__ import annotations

import ast
import os
import time
from pathlib import Path

import nbformat
import pytest
from ipykernel.kernelspec import write_kernel_spec
from nbclient import NotebookClient

import studies
from studyrunner.cli import main

ROOT = Path(studies.__file__).parent.parent
NOTEBOOKS = sorted((ROOT / "studies" / "notebooks").glob("*.ipynb"))

COARSE = ["scene.mesh=1", "slow_time.cycles=8000", "slow_time.outputs=5", "solver.harmonics=3", "solver.samples=64"]
ONE_SCHEME = ["axes.scheme=implicit", *COARSE]
SLIDER = ["axes.frequency=160.0", "slow_time.cycles=4000", "slow_time.outputs=3", "axes.samples=64"]
SMALL = {
    "dovetail": [
        "dovetail",
        'axes.sweep=["up", "down"]',
        "axes.frequency=[209.0, 212.5, 213.0]",
        "outputs.loops=[0, 3]",
        *COARSE,
    ],
    "low": ["dovetail", "axes.frequency=[209.0, 212.0]", *ONE_SCHEME],
    "high": ["dovetail", "axes.frequency=[212.5]", *ONE_SCHEME],
    "slippery": ["dovetail", "axes.frequency=[209.0, 212.0, 212.5]", "scene.friction_coefficient=0.3", *ONE_SCHEME],
    "work_precision": ["sdof_slider", "axes.step=[500, 1000, 2000]", "axes.harmonics=[1, 3, 5]", *SLIDER],
}
READS = {"error_against_run_time": ["work_precision"], "several_files": ["low", "high", "slippery"]}
FIGURES = {
    "read_a_result": 2,
    "frf_before_and_after": 2,
    "wear_maps": 3,
    "explicit_and_implicit": 3,
    "error_against_run_time": 1,
    "several_files": 1,
}


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """Paths of the small results, by name."""
    folder = tmp_path_factory.mktemp("results")
    paths = {name: folder / f"{name}.nc" for name in SMALL}
    for name, (study, *changes) in SMALL.items():
        words = [word for change in changes for word in ("--set", change)]
        assert main([study, *words, "-o", str(paths[name])]) == 0
    return paths


def code_of(path):
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "code"]


def run(path, folder, names, monkeypatch):
    """The cells of a notebook after it was executed in an empty folder."""
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR"):
        monkeypatch.setenv(name, str(folder))
    for variable in ("RESULT", "RESULTS"):
        monkeypatch.setenv(variable, ":".join(map(str, names)))
    empty = folder / "here"
    empty.mkdir()
    notebook = nbformat.read(path, as_version=4)
    # The kernel is this very interpreter, whatever kernels are installed on the machine.
    write_kernel_spec(str(folder / "kernels" / "python3"))
    monkeypatch.setenv("JUPYTER_PATH", str(folder))
    NotebookClient(notebook, kernel_name="python3", timeout=60, resources={"metadata": {"path": str(empty)}}).execute()
    return notebook.cells


def outputs(cells):
    return [output for cell in cells for output in cell.get("outputs", [])]


def count_figures(cells):
    return sum("image/png" in output.get("data", {}) for output in outputs(cells))


def written_as_warning(cells):
    return [output.text for output in outputs(cells) if output.output_type == "stream" and output.name == "stderr"]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_without_a_warning_and_draws_its_figures(path, results, tmp_path, monkeypatch):
    names = [results[name] for name in READS.get(path.stem, ["dovetail"])]
    begin = time.monotonic()
    cells = run(path, tmp_path, names, monkeypatch)
    assert time.monotonic() - begin < 60.0
    assert not written_as_warning(cells)
    assert count_figures(cells) == FIGURES[path.stem]


@pytest.mark.slow
def test_a_notebook_that_warns_or_fails_is_noticed(tmp_path, monkeypatch):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell("import warnings; warnings.warn('look out')")])
    nbformat.write(notebook, tmp_path / "warns.ipynb")
    (tmp_path / "first").mkdir()
    assert "look out" in written_as_warning(run(tmp_path / "warns.ipynb", tmp_path / "first", [], monkeypatch))[0]
    notebook.cells[0].source = "1 / 0"
    nbformat.write(notebook, tmp_path / "fails.ipynb")
    (tmp_path / "second").mkdir()
    with pytest.raises(Exception, match="ZeroDivisionError"):
        run(tmp_path / "fails.ipynb", tmp_path / "second", [], monkeypatch)


def test_all_notebooks_are_here():
    assert {path.stem for path in NOTEBOOKS} == set(FIGURES)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_stored_without_what_running_it_leaves(path):
    notebook = nbformat.read(path, as_version=nbformat.NO_CONVERT)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert notebook.metadata.kernelspec.name == "python3"
    assert dict(notebook.metadata.language_info) == {"name": "python"}
    assert notebook.cells[0].cell_type == "markdown"
    assert "run-study " in notebook.cells[0].source
    for cell in notebook.cells:
        assert not cell.metadata
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_knows_result_files_only(path):
    imported = set()
    for node in ast.walk(ast.parse("\n".join(cell.source for cell in code_of(path)))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        if isinstance(node, ast.ImportFrom):
            imported.add(node.module)
    own = {name for name in imported if name.split(".")[0] in ("solver", "studies", "studyrunner", "tests")}
    assert all(name == "studyrunner.accessor" or name.startswith("studyrunner.report.") for name in own), own
    assert own
