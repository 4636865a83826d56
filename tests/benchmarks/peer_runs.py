"""How `peers` runs other programs: environments, copies of repositories, scripts that print JSON."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import venv
from collections.abc import Callable
from pathlib import Path
from typing import Any

# One core, as the own curves. With the 32 bits that JAX takes unless told otherwise Newton's method does not converge.
_SURROUNDINGS = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "JAX_ENABLE_X64": "1"}
# frequency, Hz, and amplitude, m, of the points that converged; iterations, CPU seconds, attempts that failed
Curve = dict[str, Any]
Run = Callable[[dict[str, Any]], Curve]


def environment(folder: Path, name: str, packages: tuple[str, ...]) -> str:
    """Interpreter of an environment with the packages. Raises CalledProcessError."""
    python = folder / name / "bin" / "python"
    if not python.exists():
        venv.create(folder / name, with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "-q", *packages], check=True, capture_output=True, text=True)
    return str(python)


def repository(place: Path, address: str) -> str:
    """A copy of a repository, fetched by git if there is none. Raises CalledProcessError."""
    if not place.exists():
        subprocess.run(
            ["git", "clone", "-q", "--depth", "1", address, place], check=True, capture_output=True, text=True
        )
    return str(place)


def curve_of(command: list[str], script: str, asked: dict[str, Any]) -> Curve:
    """What a script of this folder prints last. Raises CalledProcessError, FileNotFoundError without the program."""
    command = [*command, str(Path(__file__).with_name(script)), json.dumps(asked)]
    with tempfile.TemporaryDirectory() as folder:  # pyHarm writes where it runs
        surroundings = {**os.environ, **_SURROUNDINGS}
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder, env=surroundings)
    curve: Curve = json.loads(done.stdout.splitlines()[-1])
    return curve


def attempt(name: str, run: Callable[[], None]) -> None:
    """Runs it, or says in a sentence why it is not to be had."""
    try:
        run()
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        said = (getattr(error, "stderr", None) or str(error)).strip().splitlines() or ["no message"]
        # Octave says first what is wrong, Python last
        why = next((line for line in said if line.startswith("error: ")), said[-1])
        print(f"{name} is not run here: {why}", flush=True)
