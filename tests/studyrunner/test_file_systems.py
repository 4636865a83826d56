"""Faults of a disk: the run says so, with the words of the system."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studyrunner.user_error import StorageError
from tests.mpi.launching import run_command

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]

SHIM = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int wanted(const char *variable) {
    const char *text = getenv(variable);
    return text ? atoi(text) : 0;
}

/* a result on its way, but for its first kilobyte, which may be a trial, or the progress after some writes */
static int fails(int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    if (wanted("SHIM_WRITE") && strstr(path, "/.out.nc.") && lseek(file, 0, SEEK_END) > 0) return wanted("SHIM_WRITE");
    if (!strstr(path, "out.nc.progress")) return 0;
    static int n_writes = 0;
    return ++n_writes > 25 || strstr(path, ".partial") ? wanted("SHIM_PROGRESS") : 0;
}

#define FAILING(name) \
ssize_t name(int file, const void *data, size_t count, off_t place) { \
    ssize_t (*own)(int, const void *, size_t, off_t) = dlsym(RTLD_NEXT, #name); \
    int fault = fails(file); \
    if (fault) { errno = fault; return -1; } \
    return own(file, data, count, place); \
}
FAILING(pwrite)
FAILING(pwrite64)

ssize_t write(int file, const void *data, size_t count) {
    ssize_t (*own)(int, const void *, size_t) = dlsym(RTLD_NEXT, "write");
    int fault = count > 4096 ? fails(file) : 0;
    if (fault) { errno = fault; return -1; }
    return own(file, data, count);
}
"""

STUDY = [
    *("-m", "studyrunner.cli", "two_masses", "-o", "out.nc"),
    *("--set", "axes.frequency=0.05", "--set", "axes.scheme=implicit", "--set", "slow_time.cycles=0"),
]


@pytest.fixture(scope="module")
def shim(tmp_path_factory):
    """A library that lets calls of the system fail."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        pytest.skip("there is no compiler for a library that stands in for the system's")
    folder = tmp_path_factory.mktemp("shim")
    (folder / "shim.c").write_text(SHIM, encoding="ascii")
    command = [compiler, "-shared", "-fPIC", "-o", str(folder / "shim.so"), str(folder / "shim.c"), "-ldl"]
    subprocess.run(command, check=True)
    return folder / "shim.so"


def run_with(shim, folder, **failing):
    environment = {f"SHIM_{name.upper()}": str(number) for name, number in failing.items()}
    command = ["env", "-u", "HDF5_USE_FILE_LOCKING", sys.executable, *STUDY]
    return run_command(command, folder, {"LD_PRELOAD": str(shim), **environment})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "number", "words"),
    [
        ("write", errno.ENOSPC, "No space left on device: make room there or give another result file with -o"),
        ("progress", errno.EIO, f"out.nc.progress: {os.strerror(errno.EIO)}: "),
    ],
)
def test_what_the_system_says_of_a_result_or_its_progress_is_said(what, number, words, shim, tmp_path):
    ended = run_with(shim, tmp_path, **{what: number})
    assert ended.returncode == 1
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("run-study: ")]
    assert words in line
    assert "Traceback" not in ended.stderr
    assert what == "progress" or [path.name for path in tmp_path.iterdir()] == ["out.nc.progress"]
    ended = run_with(shim, tmp_path)
    assert ended.returncode == 0
    assert "damaged" not in ended.stderr


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EDQUOT, "Disk quota exceeded"), "Disk quota exceeded: make room there or give another result"),
        (OSError(errno.EROFS, "Read-only file system"), "Read-only file system: see that it may be written or give"),
        (OSError(errno.ESTALE, "Stale file"), "Stale file: mend that or give another result file with -o"),
        (ValueError("odd"), "odd: mend that or give another result file with -o"),
    ],
)
def test_what_there_is_to_do_depends_on_the_fault(error, words):
    assert words in str(StorageError(Path("out.nc"), error))
