"""Launching it wrong says so: one line, one exit status, no hang; and what only rank 0 need see."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from tests.mpi.launching import FAKED, ROOT, fake_here, launcher, mounted, mpiexec, results, run_command

STUDY = ["sdof_slider", "-o", "out.nc", "--set", "axes.frequency={start = 100, stop = 160, num = 5}"]
OTHER_VERSION = """\
import os, runpy, sys
sys.path.insert(0, {root!r})
from studyrunner.mpi import ranks, schedule
ranks._SECONDS_TO_ANSWER = 3.0
if os.environ["PMI_RANK"] == "1":
    {change}
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


def test_launcher_of_open_mpi_and_library_of_mpich(open_mpi, tmp_path):
    done = run_command([*open_mpi.launcher(2), sys.executable, FAKED, *STUDY], tmp_path)
    assert_refused(done, "2 processes were started that cannot talk", "the launcher is that of Open MPI")
    assert list(tmp_path.iterdir()) == []


def test_launcher_of_mpich_and_library_of_open_mpi(open_mpi, tmp_path):
    done = run_command([mpiexec(), "-n", "2", open_mpi.python, FAKED, *STUDY], tmp_path, open_mpi.environment)
    assert_refused(done, "2 processes were started, but MPI knows of 1 only", "mpiexec of the environment")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("schedule.describe_software = lambda: ('elsewhere', 'other')", "rank 1 on elsewhere runs other versions"),
        ("schedule.follow_rank_0 = lambda *_: None", "rank 1 has not said within 3 s what it runs"),
    ],
    ids=["another source", "one that does not answer"],
)
def test_ranks_with_different_software(change, said, tmp_path):
    program = tmp_path / "other.py"
    program.write_text(OTHER_VERSION.format(root=str(ROOT), faked=FAKED, change=change), encoding="utf-8")
    done = run_command([*launcher(2), sys.executable, str(program), *STUDY], tmp_path)
    assert_refused(done, said, "install the same software for all ranks")
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
    assert "give a file that can be written: Read-only file system" in line


HOSTS = (1, 2)
START = """\
#!/bin/sh
# what hydra calls in place of ssh: options, the host, the command
while [ "${1#-}" != "$1" ]; do shift; done
number=${1##*.}
shift
exec ip netns exec PREFIX$number unshare --mount --uts --ipc --pid --fork --kill-child --mount-proc \\
    sh -c "hostname host$number && mount -t tmpfs none /dev/shm && $*"
"""


def tool(*command):
    subprocess.run(command, check=True, capture_output=True)


@pytest.fixture
def hosts():
    """Two hosts on one network, each with its own processes, names and memory; what their names begin with."""
    prefix = f"fw{os.getpid() % 100000}h"
    if shutil.which("ip") is None or shutil.which("unshare") is None or os.geteuid() != 0:
        pytest.skip("hosts are simulated with ip and unshare, by root only")
    try:
        tool("ip", "link", "add", f"{prefix}b", "type", "bridge")
    except subprocess.CalledProcessError as error:
        pytest.skip(f"network namespaces are not permitted here: {error.stderr}")
    try:
        tool("ip", "link", "set", f"{prefix}b", "up")
        for number in HOSTS:
            host, wire = f"{prefix}{number}", f"{prefix}w{number}"
            tool("ip", "netns", "add", host)
            tool("ip", "link", "add", wire, "type", "veth", "peer", "name", "eth0", "netns", host)
            tool("ip", "link", "set", wire, "master", f"{prefix}b", "up")
            tool("ip", "-n", host, "addr", "add", f"10.199.77.{number}/24", "dev", "eth0")
            tool("ip", "-n", host, "link", "set", "eth0", "up")
            tool("ip", "-n", host, "link", "set", "lo", "up")
        yield prefix
    finally:
        for number in HOSTS:
            subprocess.run(["ip", "netns", "del", f"{prefix}{number}"], capture_output=True, check=False)
        tool("ip", "link", "del", f"{prefix}b")


def test_two_hosts_and_one_shared_folder(hosts, tmp_path):
    """The same as on one host, and what they say to each other goes over the network."""
    starter = tmp_path / "start"
    starter.write_text(START.replace("PREFIX", hosts), encoding="utf-8")
    starter.chmod(0o755)
    addresses = ",".join(f"10.199.77.{number}" for number in HOSTS)
    several = [mpiexec(), "-launcher", "ssh", "-launcher-exec", str(starter), "-hosts", addresses, "-n", "4"]
    # all have something to do, however slow one of them is
    faked = {"FAKE_SECONDS": "0.02", "FAKE_TOGETHER": "4"}
    # hydra starts the processes of its own host without that command: it is already there
    command = " ".join(f"'{word}'" for word in [*several, sys.executable, FAKED, *STUDY])
    done = run_command([str(starter), "10.199.77.1", f"cd '{tmp_path}' && exec {command}"], tmp_path, faked)
    assert done.returncode == 0, done.stderr
    for number in HOSTS[1:]:
        sent = Path(f"/sys/class/net/{hosts}w{number}/statistics/rx_bytes").read_text(encoding="ascii")
        assert int(sent) > 20_000
    loads = {path.name for path in tmp_path.glob("rank*.txt")}
    assert len(loads) == 4
    assert fake_here([FAKED, *STUDY, "-o", "alone.nc"], tmp_path) == 0
    xr.testing.assert_identical(results(tmp_path / "out.nc"), results(tmp_path / "alone.nc"))
