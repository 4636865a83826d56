"""Launching it wrong says so: one line, one exit status, no hang; and what only rank 0 need see."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
import xarray as xr

from tests.mpi.launching import FAKED, ROOT, fake_here, launcher, mounted, results, run_command

STUDY = ["sdof_slider", "-o", "out.nc", "--set", "axes.frequency={start = 100, stop = 160, num = 5}"]
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


def assert_refused(done, *said):
    assert done.returncode == 2, done.stderr
    assert done.stdout == ""
    (line,) = [line for line in done.stderr.splitlines() if "run-study" in line]
    assert line.startswith("run-study: launcher: ")
    assert all(words in line for words in said), line
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"), "the launcher is that of Open MPI"),
        (("SLURM_STEP_NUM_TASKS", "SLURM_PROCID"), "but MPI knows of 1 only"),
    ],
)
def test_processes_of_the_launcher_of_another_library(names, said, tmp_path):
    """Processes that do not find each other say so once and compute nothing."""

    def start_rank(rank):
        environment = dict(zip(names, ("2", str(rank)), strict=True))
        return run_command([sys.executable, FAKED, *STUDY], tmp_path, environment)

    with ThreadPoolExecutor() as pool:
        first, second = pool.map(start_rank, range(2))
    assert_refused(first, "2 processes were started", said, "mpiexec of the environment")
    assert (second.returncode, second.stderr) == (2, "")
    assert list(tmp_path.iterdir()) == []


def test_ranks_with_different_software(tmp_path):
    program = tmp_path / "other.py"
    program.write_text(OTHER_VERSION.format(root=str(ROOT), faked=FAKED), encoding="utf-8")
    done = run_command([*launcher(2), sys.executable, str(program), *STUDY], tmp_path)
    assert_refused(done, "rank 1 on elsewhere runs other versions", "install the same software for all ranks")
    assert [path.name for path in tmp_path.iterdir()] == ["other.py"]


def test_only_rank_0_sees_study_scene_and_output(tmp_path):
    if os.geteuid() != 0 or subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode:
        pytest.skip("a view of its own of the file system is for root only")
    folder, elsewhere = tmp_path / "of rank 0", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    assert fake_here([FAKED, "sdof_slider", "--write-scene", str(folder / "scene.h5")], tmp_path) == 0
    text = (ROOT / "studies" / "sdof_slider.toml").read_text(encoding="utf-8")
    head, _, rest = text.partition("[scene]")
    rest = rest[rest.index("\n[") :]
    scene = '[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n'
    (folder / "study.toml").write_text(head + scene + rest, encoding="utf-8")
    study = [FAKED, str(folder / "study.toml"), *STUDY[3:], "-o", str(folder / "out.nc")]
    blind = ["-n", "2", "-wdir", str(elsewhere), "unshare", "-m", "sh", "-c", CANNOT_SEE, sys.executable, *study]
    done = run_command([*launcher(1), sys.executable, *study, ":", *blind], tmp_path, {"HIDDEN": str(folder)})
    assert done.returncode == 0, done.stderr
    assert list(elsewhere.iterdir()) == []
    assert fake_here([*study[:-1], str(folder / "alone.nc")], tmp_path) == 0
    xr.testing.assert_identical(results(folder / "out.nc"), results(folder / "alone.nc"))


def test_an_output_that_cannot_be_written(tmp_path):
    with mounted(tmp_path / "read-only", "ro") as folder:
        done = run_command([*launcher(2), sys.executable, FAKED, *STUDY, "-o", str(folder / "out.nc")], tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "Read-only file system" in line
