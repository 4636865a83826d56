"""Launching it wrong says so: one line, one exit status, no hang; and what only rank 0 need see."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.mpi.launching import FAKED, ROOT, launcher, options, results, run_command, run_here, run_to_end

FREQUENCIES = options("axes.frequency={start = 100, stop = 160, num = 5}")
STUDY = ["sdof_slider", *FREQUENCIES, "-o", "out.nc"]
OTHER_VERSION = """\
import os, runpy, sys
sys.path.insert(0, {root!r})
from studyrunner.mpi import ranks
if os.environ["PMI_RANK"] == "1":
    ranks.describe_software = lambda: ("elsewhere", "other")
sys.argv = [{faked!r}, *sys.argv[1:]]
runpy.run_path({faked!r}, run_name="__main__")
"""
CANNOT_SEE = 'mount -t tmpfs none "$HIDDEN" && exec "$0" "$@"'
"""Started with a view of its own of the file system, in which the folder HIDDEN is empty."""


def assert_refused(ended, *said):
    assert (ended.status, ended.out) == (2, "")
    (line,) = [line for line in ended.said.splitlines() if "run-study" in line]
    assert line.startswith("run-study: launcher: ")
    assert all(words in line for words in said), line
    assert "Traceback" not in ended.said


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"), "Open MPI"),
        (("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"), "1 only"),
    ],
)
def test_processes_of_the_launcher_of_another_library(names, said, tmp_path):
    """Processes that do not find each other say so once and compute nothing."""

    def start_rank(rank):
        return run_to_end(0, [FAKED, *STUDY], tmp_path, dict(zip(names, ("2", str(rank)), strict=True)))

    with ThreadPoolExecutor() as pool:
        first, second = pool.map(start_rank, range(2))
    assert_refused(first, "2 processes", said, "mpiexec")
    assert (second.status, second.said) == (2, "")
    assert list(tmp_path.iterdir()) == []


def test_ranks_with_different_software(tmp_path):
    program = tmp_path / "other.py"
    program.write_text(OTHER_VERSION.format(root=str(ROOT), faked=FAKED), encoding="utf-8")
    assert_refused(run_to_end(2, [str(program), *STUDY], tmp_path), "rank 1", "elsewhere")
    assert [path.name for path in tmp_path.iterdir()] == ["other.py"]


def test_only_rank_0_sees_study_scene_and_output(tmp_path):
    if os.geteuid() != 0 or subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode:
        pytest.skip("a view of its own of the file system is for root only")
    folder, elsewhere = tmp_path / "of rank 0", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    assert run_here([FAKED, "sdof_slider", "--write-scene", str(folder / "scene.h5")], tmp_path) == 0
    text = (ROOT / "studies" / "sdof_slider.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[scene]")
    scene = '[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n'
    (folder / "study.toml").write_text(head + scene + rest[rest.index("\n[") :], encoding="utf-8")
    study = [FAKED, str(folder / "study.toml"), *FREQUENCIES, "-o", str(folder / "out.nc")]
    blind = ["-n", "2", "-wdir", str(elsewhere), "unshare", "-m", "sh", "-c", CANNOT_SEE, sys.executable, *study]
    ended = run_command([*launcher(1), sys.executable, *study, ":", *blind], tmp_path, {"HIDDEN": str(folder)})
    assert ended.status == 0, ended.said
    assert list(elsewhere.iterdir()) == []
    assert run_here([*study[:-1], str(folder / "alone.nc")], tmp_path) == 0
    assert results(folder / "out.nc").identical(results(folder / "alone.nc"))
