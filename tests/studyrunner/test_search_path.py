"""Files that lie beside a study and bear the names of modules: no process of the commands ever runs one."""

import shutil
import sys
from pathlib import Path

import pytest

from studies.sandboxed_read import check_result_readable, check_scene_readable
from studies.scene_error import SceneError
from studyrunner.cli import main
from studyrunner.netcdf.output import progress_file
from tests.mpi.launching import launcher, run_command

ROOT = Path(__file__).parents[2]
FOREIGN = "import os\nopen(os.path.join({folder!r}, 'taken'), 'a').write(__name__ + ' ')\nraise SystemExit(77)\n"


NAMES = (
    *("json.py", "h5py/__init__.py", "numpy.py", "netCDF4.py", "xarray/__init__.py", "solver.py", "resource.py"),
    *("matplotlib.py", "argparse.py", "subprocess.py", "typing_extensions.py", "mpi4py/__init__.py"),
    "rich/__init__.py",
)


SMALL = ("axes.frequency=150", "slow_time.cycles=0", "axes.scheme=implicit")
PLUGIN = "[xarray.backends]\nforeign = foreign_plugin:Backend\n[pydantic]\nforeign = foreign_plugin:plugin\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a scene and a result."""
    folder = tmp_path_factory.mktemp("made")
    scene, result = folder / "scene.h5", folder / "result.nc"
    study = ["sdof_slider", *(part for text in SMALL for part in ("--set", text))]
    assert main([*study, "--write-scene", str(scene)]) == 0
    assert main([*study, "-o", str(result)]) == 0
    progress_file(result).unlink()
    return folder


@pytest.fixture
def hostile(made, tmp_path):
    """A folder with a study, its scene, its result, and everything that could be mistaken for a module."""
    folder = tmp_path / "hostile"
    shutil.copytree(made, folder)
    text = '[study]\nname = "s"\n[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n[axes]\nfrequency = 150.0\n'
    (folder / "study.toml").write_text(f"{text}[slow_time]\ncycles = 0\noutputs = 1\n", encoding="utf-8")
    for name in (*NAMES, "foreign_plugin.py"):
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(FOREIGN.format(folder=str(tmp_path)), encoding="utf-8")
    # a cache of compiled code is no data either
    (folder / ".numba_config.yaml").write_text(f"cache_dir: {folder / 'cache'}\n", encoding="utf-8")
    # innocent: a folder of studies that somebody made a package of
    (folder / "studies").mkdir()
    (folder / "studies" / "__init__.py").touch()
    (folder / "foreign-1.0.dist-info").mkdir()
    (folder / "foreign-1.0.dist-info" / "METADATA").write_text("Name: foreign\nVersion: 1.0\n", encoding="utf-8")
    (folder / "foreign-1.0.dist-info" / "entry_points.txt").write_text(PLUGIN, encoding="utf-8")
    return folder


def assert_nothing_taken(folder):
    taken = folder.parent / "taken"
    assert not taken.exists(), taken.read_text(encoding="utf-8")
    assert not (folder / "cache").exists()


@pytest.mark.slow
def test_the_process_that_reads(hostile, monkeypatch):
    # as in a notebook, or a script, that stands in the folder
    monkeypatch.chdir(hostile)
    monkeypatch.syspath_prepend("")
    check_scene_readable(Path("scene.h5"))
    check_result_readable(Path("result.nc"))
    Path("scene.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with pytest.raises(SceneError, match="damaged"):
        check_scene_readable(Path("scene.h5"))
    assert_nothing_taken(hostile)


MODULE = (sys.executable, "-m", "studyrunner.cli")
REPORT = (sys.executable, "-m", "studyrunner.report.cli")
# as they are installed
SCRIPTS = [
    (sys.executable, "-c", f"import sys\nfrom {name} import main\nsys.exit(main())\n")
    for name in ("studyrunner.cli", "studyrunner.report.cli")
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "arguments", "python_path"),
    [
        (MODULE, ["result.nc", "-o", "again.nc"], f"{ROOT}"),
        (REPORT, ["result.nc"], f"{ROOT}"),
        # an empty entry, as scripts that extend the variable leave it, means the current folder
        (SCRIPTS[0], ["study.toml", "--plan"], f".:{ROOT}"),
        (SCRIPTS[1], ["result.nc"], f":{ROOT}"),
        ((*launcher(2), *MODULE), ["study.toml", "-o", "out.nc"], f"{ROOT}"),
    ],
    ids=["run-study", "study-report", "script", "script of the report", "mpiexec"],
)
def test_commands(command, arguments, python_path, hostile):
    done = run_command([*command, *arguments], hostile, {"PYTHONPATH": python_path})
    assert_nothing_taken(hostile)
    assert done.returncode == 0, done.stderr
    assert "-o" not in arguments or (hostile / arguments[-1]).exists()


def test_folders_of_python_path_are_searched(tmp_path, monkeypatch):
    """Only the current folder is left out, and not where the project lies in it."""
    from studies.guards.search_path import search_path

    monkeypatch.syspath_prepend(str(tmp_path))
    assert str(tmp_path) in search_path()
    monkeypatch.chdir(tmp_path)
    assert str(tmp_path) not in search_path()
    monkeypatch.syspath_prepend(str(ROOT))
    monkeypatch.chdir(ROOT)
    assert str(ROOT) in search_path()
