#!/usr/bin/env bash
# A clean environment with the lowest versions of all that pyproject.toml declares, in it the wheel that is built from the
# sdist of this tree, and a short study: computed alone and on two ranks, run again from its result, and drawn. All
# bundled studies, notebooks, pictures and pages are there without the tree.
#
#   tests/benchmarks/lowest_versions.sh [PYTHON] [lowest|newest]
#
# PYTHON: an interpreter, 3.11 or later. newest: the same with the newest versions, to try another interpreter.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
python=${1:-python3}
which=${2:-lowest}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# not in the tree itself: what is built there would stay
mkdir "$work/source"
(cd "$root" && cp -r solver studies studyrunner fretwear.py pyproject.toml README.md LICENSE "$work/source")
(cd "$root" && find solver studies studyrunner -type f ! -name "*.py" ! -name "*.nb[ci]" ! -name "*.pyc" | sort) >"$work/files.txt"
"$python" -m venv "$work/env"
own=$work/env/bin
touch "$work/constraints.txt"
if [ "$which" = lowest ]; then
  "$own/python" - "$root/pyproject.toml" >"$work/constraints.txt" <<'END'
import sys
import tomllib

with open(sys.argv[1], "rb") as file:
    project = tomllib.load(file)["project"]
for requirement in [*project["dependencies"], *project["optional-dependencies"]["mpi"]]:
    print(requirement.replace(">=", "=="))
END
fi
"$own/pip" install -q "setuptools>=77"
(cd "$work/source" && "$own/python" -c 'from setuptools.build_meta import build_sdist; build_sdist("..")' >/dev/null)
"$own/pip" wheel -q --no-deps -w "$work" "$work"/fretwear-*.tar.gz
wheel=$(ls "$work"/fretwear-*.whl)
"$own/pip" install -q -c "$work/constraints.txt" "fretwear[mpi] @ file://$wheel"
"$own/pip" check
"$own/pip" list --format freeze | grep -v "^pip=\|^setuptools=" | paste -sd ' '

# in a folder without the source: only what the wheel holds is there
mkdir "$work/here"
cd "$work/here"
study=(sdof_slider --set 'axes.frequency=[150.0, 160.0]' --set slow_time.cycles=2000 --set slow_time.outputs=3)
"$own/run-study" --plan >/dev/null
"$own/run-study" "${study[@]}" --set 'outputs.loops=[0]' -o alone.nc
"$own/mpiexec" -n 2 "$own/run-study" "${study[@]}" --set 'outputs.loops=[0]' -o ranks.nc
"$own/run-study" alone.nc -o again.nc
"$own/study-report" alone.nc
"$own/run-study" dovetail --write-scene root.h5
"$own/python" - <<'END'
from pathlib import Path

import solver
import xarray as xr
from studyrunner import read_study
from studyrunner.study.study_file import bundled_studies

installed = Path(solver.__file__).parents[1]
assert "site-packages" in installed.parts, f"not the installed one: {installed}"
missing = [name for name in Path("../files.txt").read_text().split() if not (installed / name).is_file()]
assert not missing, f"left out of the wheel: {missing}"
for name in bundled_studies():
    read_study(name)

alone, ranks, again = (xr.load_dataset(f"{name}.nc").drop_vars("run_time") for name in ("alone", "ranks", "again"))
assert alone.equals(ranks) and alone.equals(again), "the results differ"
END
echo "$("$own/python" --version) with the $which versions: all is well"
