"""The ranks compare the versions of their software before anything else: with other versions the numbers may differ.

By hand: mpi4py exchanges messages between ranks of any versions.
"""

from __future__ import annotations

import hashlib
import platform
import time
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from studyrunner.mpi.launcher import LauncherError
from studyrunner.mpi.ranks import POLL_SECONDS, Ranks

SECONDS_TO_ANSWER = 60.0
"""Longest time for an answer, s. All ranks have started when rank 0 asks; an older version never answers."""

_REMEDY = "install the same software for all ranks"
_PACKAGES = ("fretwear", "numba", "numpy", "scipy")
_SOURCE = "source of run-study"
_SOURCES = ("solver", "studies", "studyrunner")


def describe_software() -> dict[str, str]:
    """Versions of the software of this process, by name; a hash stands for the source."""
    digest = hashlib.sha256()
    for package in _SOURCES:
        specification = find_spec(package)
        for folder in (specification.submodule_search_locations or []) if specification is not None else []:
            for path in sorted(Path(folder).rglob("*.py")):
                digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return {
        "processor": platform.machine(),
        "Python": platform.python_version(),
        **{package: _version(package) for package in _PACKAGES},
        _SOURCE: digest.hexdigest()[:12],
    }


def report_version(ranks: Ranks) -> None:
    """Any other rank: tells rank 0 the name of its machine and its versions."""
    ranks.send((platform.node(), describe_software()), 0)


def check_versions(ranks: Ranks, seconds: float = SECONDS_TO_ANSWER) -> None:
    """Rank 0: compares the versions of all ranks.

    Raises
    ------
    LauncherError
        Where another rank has other versions, or does not answer within `seconds`.
    KeyboardInterrupt
        Where another rank was interrupted.
    """
    if ranks.size == 1:
        return
    own = describe_software()
    silent = set(range(1, ranks.size))
    differences = {}
    latest = time.monotonic() + seconds
    while silent:
        received = ranks.receive()
        if received is None:
            if time.monotonic() > latest:
                raise LauncherError(f"rank {min(silent)} has not said within {seconds:.0f} s what it runs: {_REMEDY}")
            time.sleep(POLL_SECONDS)
            continue
        rank, said = received
        match said:
            case (str(host), dict(software)):
                silent.discard(rank)
                if software != own:
                    differences[rank] = _difference(own, host, software)
            case _:
                raise KeyboardInterrupt
    if differences:
        first = min(differences)
        more = f" (and {len(differences) - 1} more)" if len(differences) > 1 else ""
        raise LauncherError(f"rank {first}{more} {differences[first]}: {_REMEDY}")


def _difference(own: dict[str, str], host: str, other: dict[str, str]) -> str:
    for name in own:
        if other.get(name) != own[name]:
            return f"on {host} runs {name} {other.get(name, 'unknown')}, rank 0 on {platform.node()} runs {own[name]}"
    return f"on {host} runs something else than rank 0 on {platform.node()}"


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "none"
