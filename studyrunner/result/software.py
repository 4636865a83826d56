"""Software of a result: address of publication and commit. What is not known, or cannot be found, is left out.

By hand: `setuptools-scm` knows the commit of the installation, not of the checkout that runs.
"""

from __future__ import annotations

import json
import os
import subprocess
from importlib import metadata
from pathlib import Path

CHANGED = " with local changes"
"""End of the text of a commit with changed files."""

_PUBLISHED_AS = ("repository", "source", "source code", "homepage", "documentation")
_SECONDS_FOR_GIT = 5.0


def describe_software(name: str) -> dict[str, str]:
    """Attributes `software_url` and `software_commit` of a result, of the distribution of this name."""
    labelled = {}
    for line in metadata.metadata(name).get_all("Project-URL") or []:
        label, _, url = line.partition(",")
        labelled[label.strip().lower()] = url.strip()
    try:
        # of a package that was installed from a repository (PEP 610)
        commit = json.loads(metadata.distribution(name).read_text("direct_url.json") or "{}")["vcs_info"]["commit_id"]
    except (ValueError, TypeError, KeyError):
        commit = ""
    # the checkout that the code is run from, if it is one; else what was installed
    commit = commit_of(Path(__file__).parents[2]) or commit
    found = {"software_url": next((labelled[label] for label in _PUBLISHED_AS if label in labelled), "")}
    found |= {"software_commit": commit if isinstance(commit, str) else ""}
    return {key: text for key, text in found.items() if text}


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
