"""Runs the notebooks of `studies/notebooks` and stores in them what comes out, as a forge shows it.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.notebooks dovetail.nc [trends wear_maps ...]

`dovetail.nc` is the result of the bundled study; three notebooks read `scatter.nc`, `modes.nc` and `mission.nc` beside
it, the results of the bundled studies of these names. Without names all are run, in a folder of their own. Two runs on
one machine store the same, but for the CPU times of `error_against_run_time`.
"""

import base64
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import nbformat
from jupyter_client import AsyncKernelManager
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient
from nbformat import NotebookNode

import studies
from tests.benchmarks.pictures import shrink

ROOT = Path(studies.__file__).parent.parent
NOTEBOOKS = tuple(sorted((ROOT / "studies" / "notebooks").glob("*.ipynb")))
LANGUAGE = {"name": "python"}
RESULTS = ("scatter.nc", "modes.nc", "mission.nc")


class OwnKernel(AsyncKernelManager):
    """The kernel of this very interpreter, whatever kernels are installed on the machine."""

    def _kernel_spec_manager_default(self) -> KernelSpecManager:
        return KernelSpecManager(kernel_dirs=[])


def execute(path: Path, here: Path, variables: Mapping[str, str]) -> NotebookNode:
    """A notebook after its cells were run in an empty folder, without settings of the user, by this interpreter.

    variables: of the environment, beside those of this process but what names another result. Raises
    CellExecutionError of nbclient.
    """
    notebook = nbformat.read(path, as_version=4)
    surroundings = {name: value for name, value in os.environ.items() if name not in ("RESULT", "RESULTS")}
    surroundings |= dict.fromkeys(("IPYTHONDIR", "JUPYTER_CONFIG_DIR"), str(here.with_name(f"{here.name}-jupyter")))
    surroundings["MPLBACKEND"] = "module://matplotlib_inline.backend_inline"
    surroundings["PYTHONPATH"] = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    options = {"kernel_manager_class": OwnKernel, "kernel_name": "python3", "timeout": 300, "record_timing": False}
    client = NotebookClient(notebook, resources={"metadata": {"path": str(here)}}, **options)
    client.execute(env={**surroundings, **variables})
    return notebook


def settle(notebook: NotebookNode) -> NotebookNode:
    """The notebook without what differs from run to run and from machine to machine, its pictures in few colours."""
    notebook.metadata.language_info = nbformat.from_dict(LANGUAGE)
    for cell in notebook.cells:
        cell.metadata = nbformat.from_dict({})
        if cell.cell_type != "code":
            continue
        joined: list[NotebookNode] = []
        for output in cell.outputs:
            data = output.get("data", {})
            if data:
                output.metadata = nbformat.from_dict({})
            # the interactive view of a dataset has new random names each time, and a forge shows it badly
            if "xr-wrap" in data.get("text/html", ""):
                del data["text/html"]
            if "image/png" in data:
                data["image/png"] = base64.b64encode(shrink(base64.b64decode(data["image/png"]))).decode()
            # what is printed arrives in pieces, of a number that differs
            if joined and output.output_type == "stream" and joined[-1].get("name") == output.name:
                joined[-1].text += output.text
            else:
                joined.append(output)
        cell.outputs = joined
    return notebook


def main() -> None:
    result, *names = sys.argv[1:]
    for path in NOTEBOOKS:
        if names and path.stem not in names:
            continue
        with tempfile.TemporaryDirectory() as folder:
            here = Path(folder, "here")
            here.mkdir()
            (here / "dovetail.nc").symlink_to(Path(result).resolve(strict=True))
            for other in RESULTS:
                if Path(result).with_name(other).is_file():
                    (here / other).symlink_to(Path(result).resolve().with_name(other))
            nbformat.write(settle(execute(path, here, {})), path)
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
