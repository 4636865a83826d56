"""run-study under mpiexec: the same result for any number of ranks; launching it wrong says so, once."""

import contextlib
import mmap
import os
import signal
import subprocess
import sys
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import xarray as xr

from studyrunner.mpi import ranks
from tests.benchmarks.overhead import run
from tests.mpi.launching import (
    CHEAP,
    FAKED,
    ROOT,
    SOON,
    count_entries,
    launcher,
    options,
    results,
    run_command,
    run_here,
    run_to_end,
)
from tests.studyrunner import small_studies

GRID = (
    *(FAKED, *CHEAP),
    *options("axes.frequency={start = 100, stop = 160, num = 7}", "axes.sweep=['up', 'down']"),
    *options("axes.step=[500, 1000]", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
    *options("axes.scheme=['implicit', 'adaptive']"),
)


def test_result_does_not_depend_on_the_number_of_ranks(tmp_path):
    found, tables = {}, set()
    for n_ranks in (0, 1, 3):
        ended = run_to_end(n_ranks, [*GRID, "-o", f"{n_ranks}.nc"], tmp_path)
        assert ended.status == 0, ended.said
        summary, *table = ended.out.splitlines()
        tables.add("\n".join(table))
        assert summary.startswith(f"{n_ranks}.nc: 168 points, 168 computed, 0 failed")
        found[n_ranks] = results(tmp_path / f"{n_ranks}.nc")
    for n_ranks in (1, 3):
        xr.testing.assert_identical(found[n_ranks], found[0])
    assert len(tables) == 1


def test_bad_input_is_said_once(tmp_path):
    ended = run_to_end(2, [FAKED, "sdof_slider", "--set", "axes.frequency=-1"], tmp_path)
    assert (ended.status, ended.out) == (2, "")
    (line,) = ended.said.splitlines()
    assert "sdof_slider: axes.frequency = -1: " in line
    assert list(tmp_path.iterdir()) == []


def test_rank_0_does_not_hold_results(tmp_path):
    """Six times as many points take hardly more memory."""
    outputs, few, many = 64_001, 100, 600
    less, more = (run(0, n_points, tmp_path, f"{n_points}.nc", outputs) for n_points in (few, many))
    size = (many - few) * outputs * 8 / 2**20
    assert more.memory - less.memory < 80.0 < 0.4 * size


# --- with the solver itself ---

SHORT = options("slow_time.outputs=3", "solver.harmonics=3")
SCENES = (
    *("sdof_slider", *SHORT),
    *options("axes.frequency=160", "axes.scheme=implicit", "axes.stiffness=[1.6e5, 1.65e5, 1.7e5]"),
    *options("scatter={samples = 2, friction_coefficient = {normal = {std = 0.03}}, mass = {normal = {std = 1e-3}}}"),
    *options("solver.samples=32", "slow_time.cycles=2000"),
)
"""Six scenes, of which each rank holds two at most."""

JOINT = (
    *("dovetail", *SHORT),
    *options("axes.frequency=212.5", "axes.scheme=['explicit', 'adaptive']", "scene.mesh=1"),
    *options("solver.samples=64", "slow_time.cycles=3000", "outputs.loops=[0, 5]"),
)


MODES = (
    *("modes.toml", *options("axes.modal_amplitude={start = 2e-5, stop = 1e-3, num = 10, spacing = 'log'}")),
    *options("axes.sweep=down", "axes.friction_coefficient=[0.4, 0.6]"),
)
BLOCKS = "{name = 'hard', excitation_amplitude = 14.0, cycles = 3000}, "
BLOCKS += "{name = 'heavy', normal_load = 12.0, excitation_amplitude = 14.0, cycles = 2000}"
MISSIONS = (
    *("missions.toml", *options("scene.normal_stiffness=0", "axes.frequency=160", "axes.wear_coefficient=1e-11")),
    *options("axes.sweep=up", "axes.damping=[0.0, 0.5]", "slow_time.missions=1", "slow_time.outputs=2"),
    *options("solver={harmonics = 3, samples = 64, rtol = 0.1}", f"mission=[{BLOCKS}]"),
)


@pytest.mark.parametrize(
    ("study", "kills"),
    [
        # when some of the scenes are built, then when some of the histories are there, and all start states
        (SCENES, [("computed", 0, 1), ("result", 6, 0)]),
        (MODES, [("result", 2, 1)]),
        # two points with two scenes each: a rank gets both models of a mission with its task
        (MISSIONS, []),
        (JOINT, []),
    ],
)
def test_a_study_ends_with_the_result_of_one_process(study, kills, tmp_path):
    """On two ranks; after kills on three, of which one has nothing to do. kills: (kind, entries to wait for, rank)."""
    for name, text in (("modes", small_studies.MODES), ("missions", small_studies.MISSIONS)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    assert run_here([*study, "-o", "alone.nc"], tmp_path) in (0, 3)
    expected = results(tmp_path / "alone.nc")
    command = ["-m", "studyrunner.cli", *study, "-o", "out.nc"]
    for kind, n_entries, rank in kills:

        def kill(running, kind=kind, n_entries=n_entries, rank=rank):
            assert running.reaches(lambda: count_entries(kind, tmp_path / "out.nc") > n_entries), running.said
            with contextlib.suppress(ProcessLookupError, KeyError):
                os.kill(running.ranks()[rank], signal.SIGKILL)

        assert run_to_end(2, command, tmp_path, disturb=kill).status != 0
        assert count_entries(kind, tmp_path / "out.nc") > n_entries
    ended = run_to_end(3 if kills else 2, command, tmp_path)
    assert ended.status == 0, ended.said
    xr.testing.assert_identical(results(tmp_path / "out.nc"), expected)
    if study is SCENES:
        assert expected.worn_volume.sizes["stiffness"] * expected.worn_volume.sizes["sample"] == 6
    if study is JOINT:
        assert expected.loop_force.notnull().any(["cycle", "phase", "component"]).sum() == 2 * 2
        assert "mesh_quad" in expected
    assert "worn_volume" not in expected or (expected.worn_volume.max() > 0.0)


HOLD = "import mmap, sys; file = open(sys.argv[1], 'r+b'); held = mmap.mmap(file.fileno(), 0); print(); input()"


@pytest.fixture
def shared(monkeypatch):
    """Begin of the names of memory that is taken for that of MPICH."""
    begin = f"{ranks._SHARED}{uuid.uuid4().hex}_"
    monkeypatch.setattr(ranks, "_SHARED", begin)
    yield begin
    for path in Path(begin).parent.glob(f"{Path(begin).name}*"):
        path.unlink()


def test_memory_of_killed_ranks_is_removed_and_no_other(shared):
    """That of an old run which is alive has lost its name long ago, but for that of another program."""
    paths = {name: Path(shared + name) for name in ("dead", "young", "held", "foreign", "own")}
    for path in paths.values():
        path.write_bytes(bytes(4096))
        os.utime(path, (0, 0) if path.name[-5:] != "young" else None)
    foreign = os.geteuid() == 0
    if foreign:
        os.chown(paths["foreign"], 12345, -1)
    with (
        subprocess.Popen([sys.executable, "-c", HOLD, paths["held"]], stdin=-1, stdout=-1) as holder,
        paths["own"].open("r+b") as file,
        mmap.mmap(file.fileno(), 0),
    ):
        assert holder.stdout.readline()
        ranks._unlink_shared_memory()
        left = {name for name, path in paths.items() if path.exists()}
        holder.communicate(b"\n")
    assert left == {"young", "held"} | ({"foreign"} if foreign else set())


# --- launching it wrong ---

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
ENDS_EARLY = """\
import os, signal, sys
class Finder:
    @staticmethod
    def find_spec(name, *_):
        if name == "mpi4py" and os.environ["PMI_RANK"] == "{rank}":
            {what}
sys.meta_path.insert(0, Finder)
from studyrunner.cli import main
sys.exit(main())
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


@pytest.mark.parametrize(
    ("rank", "what"),
    [
        (0, "raise ImportError('none here')"),
        (1, "raise ImportError('none here')"),
        (1, "os.kill(os.getpid(), signal.SIGTERM)"),
        (1, "open('gone', 'w').close(); os._exit(130)"),
    ],
)
def test_a_rank_that_ends_before_it_has_found_the_others_ends_all(rank, what, tmp_path):
    """The others wait in MPI_Init, and the launcher takes the end for a good one, unless it is by a signal."""
    program = tmp_path / "early.py"
    program.write_text(ENDS_EARLY.format(rank=rank, what=what), encoding="utf-8")

    def end(running):
        if "_exit" in what:
            # no process that could tell the launcher is left
            assert running.reaches((tmp_path / "gone").exists)
            time.sleep(2.0)
            running.process.terminate()

    ended = run_to_end(2, [str(program), *STUDY], tmp_path, disturb=end)
    assert ended.status != 0
    assert ended.seconds < SOON
    assert "Traceback" not in ended.said
    if "raise" in what:
        (line,) = [line for line in ended.said.splitlines() if "run-study" in line]
        assert line.startswith("run-study: launcher: 2 processes were started that cannot talk (none here): ")


def test_ranks_with_different_software(tmp_path):
    program = tmp_path / "other.py"
    program.write_text(OTHER_VERSION.format(root=str(ROOT), faked=FAKED), encoding="utf-8")
    assert_refused(run_to_end(2, [str(program), *STUDY], tmp_path), "elsewhere", "different versions")
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
