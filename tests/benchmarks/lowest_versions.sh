#!/usr/bin/env bash
# A clean environment with the lowest versions of all that pyproject.toml declares, the wheel of this tree in it, and a
# short study: computed alone and on two ranks, run again from its result, and drawn.
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
(cd "$root" && cp -r solver studies studyrunner pyproject.toml README.md "$work/source")
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
"$own/pip" wheel -q --no-deps -w "$work" "$work/source"
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
import xarray as xr

alone, ranks, again = (xr.load_dataset(f"{name}.nc").drop_vars("run_time") for name in ("alone", "ranks", "again"))
assert alone.equals(ranks) and alone.equals(again), "the results differ"
END
echo "$("$own/python" --version) with the $which versions: all is well"
