"""Runs the notebooks of `studies/notebooks` and stores in them what comes out, as a forge shows it.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.notebooks dovetail.nc
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.notebooks dovetail.nc trends wear_maps

`dovetail.nc` is the result of the bundled study, `run-study dovetail`, read by some notebooks; three read `scatter.nc`,
`modes.nc` and `mission.nc` beside it, the results of the bundled studies of these names; the others run a small study
of their own. Without names all are run, in a folder of their own. Two runs on one machine store the same, but for the
CPU times of `error_against_run_time`: nothing is kept of when, where and by which version of Python they ran.
"""

import argparse
import base64
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import nbformat
from ipykernel.kernelspec import write_kernel_spec
from nbclient import NotebookClient
from nbformat import NotebookNode

import studies
from tests.benchmarks.small_png import shrink

ROOT = Path(studies.__file__).parent.parent
NOTEBOOKS = tuple(sorted((ROOT / "studies" / "notebooks").glob("*.ipynb")))
LANGUAGE = {"name": "python"}
_HTML_OF_XARRAY = "xr-wrap"
"""A class in the interactive view of a dataset: it has new random names each time, and a forge shows it badly."""


def execute(path: Path, here: Path, variables: Mapping[str, str]) -> NotebookNode:
    """A notebook after its cells were run in a folder.

    Parameters
    ----------
    path
        The notebook; it is not changed.
    here
        Empty folder to run in; the settings of Jupyter and IPython are beside it, those of the user are not read.
    variables
        Of the environment, beside those of this process; what names another result is not taken from there.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        Where a cell fails.
    """
    aside = here.with_name(f"{here.name}-jupyter")
    # The kernel is this very interpreter, whatever kernels are installed on the machine.
    write_kernel_spec(str(aside / "kernels" / "python3"))
    own = dict.fromkeys(("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_RUNTIME_DIR", "JUPYTER_PATH"), str(aside))
    own["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    own["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    notebook = nbformat.read(path, as_version=4)
    before = dict(os.environ)
    # what finds the kernel reads the environment of this process
    for name in ("RESULT", "RESULTS"):
        os.environ.pop(name, None)
    os.environ.update(own, **variables)
    try:
        resources = {"metadata": {"path": str(here)}}
        options = {"kernel_name": "python3", "timeout": 300, "record_timing": False}
        NotebookClient(notebook, resources=resources, **options).execute()
    finally:
        os.environ.clear()
        os.environ.update(before)
    return notebook


def settle(notebook: NotebookNode) -> NotebookNode:
    """The notebook without what differs from run to run and from machine to machine, its pictures in few colours."""
    notebook.metadata.language_info = nbformat.from_dict(LANGUAGE)
    for cell in notebook.cells:
        cell.metadata = nbformat.from_dict({})
        if cell.cell_type != "code":
            continue
        cell.outputs = _join_streams(cell.outputs)
        for output in cell.outputs:
            data = output.get("data", {})
            if data:
                output.metadata = nbformat.from_dict({})
            if _HTML_OF_XARRAY in data.get("text/html", ""):
                del data["text/html"]
            if "image/png" in data:
                data["image/png"] = base64.b64encode(shrink(base64.b64decode(data["image/png"]))).decode()
    return notebook


def _join_streams(outputs: Sequence[NotebookNode]) -> list[NotebookNode]:
    """What is printed arrives in pieces, of a number that differs: pieces that follow each other are one."""
    joined: list[NotebookNode] = []
    for output in outputs:
        before = joined[-1] if joined else None
        if before is not None and output.output_type == "stream" and before.get("name") == output.name:
            before.text += output.text
        else:
            joined.append(output)
    return joined


def main(arguments: Sequence[str] | None = None) -> None:
    """Remakes the outputs of the notebooks that are named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("result", type=Path, help="result file of the bundled study dovetail")
    parser.add_argument("names", nargs="*", help=f"of {', '.join(path.stem for path in NOTEBOOKS)}")
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - {path.stem for path in NOTEBOOKS}:
        parser.error(f"no notebooks: {', '.join(sorted(unknown))}")
    result = options.result.resolve(strict=True)
    for path in NOTEBOOKS:
        if options.names and path.stem not in options.names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            here = Path(folder, "here")
            here.mkdir()
            (here / "dovetail.nc").symlink_to(result)
            for other in ("scatter.nc", "modes.nc", "mission.nc"):
                if result.with_name(other).is_file():
                    (here / other).symlink_to(result.with_name(other))
            nbformat.write(settle(execute(path, here, {})), path)
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
