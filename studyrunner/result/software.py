"""Commit of the software that computes a result, in its checkout; left out where it is not known.

By hand: `setuptools-scm` knows the commit of the installation, not of the checkout that runs.
"""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

CHANGED = " with local changes"
"""End of the text of a commit with changed files."""

_SECONDS_FOR_GIT = 5.0


def describe_software() -> dict[str, str]:
    """Attribute `software_commit` of a result; none where the code runs from no checkout."""
    commit = commit_of(Path(__file__).parents[2])
    return {"software_commit": commit} if commit else {}


def commit_of(folder: Path) -> str:
    """Commit that is checked out in a folder, with `CHANGED` where files were changed; empty where unknown.

    The commit of a folder inside a checkout, such as an environment, is unknown.
    """
    if not (folder / ".git").exists():
        return ""
    # a hook or an alias of the caller's own repository, whose variables are set, is not meant; nothing is written
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    command = ["git", "-C", str(folder), "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty"]
    clean |= {"GIT_OPTIONAL_LOCKS": "0"}
    try:
        said = subprocess.check_output(
            command, text=True, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=_SECONDS_FOR_GIT, env=clean
        )
    except (OSError, ValueError, subprocess.SubprocessError):
        return ""
    commit = said.strip()
    return commit.removesuffix("-dirty") + CHANGED if commit.endswith("-dirty") else commit
