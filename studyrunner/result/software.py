"""Software of a result: address of publication and commit, where they are known.

A result does not need these attributes: what is missing, damaged or slow is left out.

By hand: `setuptools-scm` knows the commit of the installation, not of the checkout that runs.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path

CHANGED = " with local changes"
"""End of the text of a commit with changed files."""

_PUBLISHED_AS = ("repository", "source", "source code", "homepage", "documentation")
_SECONDS_FOR_GIT = 5.0


def describe_software(name: str) -> dict[str, str]:
    """Attributes `software_url` and `software_commit` of a result; each only where known.

    Parameters
    ----------
    name
        Name of the distribution.
    """
    origin = _installed_from(metadata.distribution(name).read_text("direct_url.json"))
    url = published_at(metadata.metadata(name).get_all("Project-URL") or [])
    # the checkout that the code is run from, if it is one; else what was installed
    commit = commit_of(Path(__file__).parents[2]) or origin.get("commit_id", "")
    found = {"software_url": url or origin.get("url", ""), "software_commit": commit}
    return {key: text for key, text in found.items() if text}


def published_at(urls: list[str]) -> str:
    """URL of the source in the metadata of a package; empty where there is none."""
    labelled = {label.strip().lower(): url.strip() for label, _, url in (line.partition(",") for line in urls)}
    return next((labelled[label] for label in _PUBLISHED_AS if labelled.get(label)), "")


def commit_of(folder: Path) -> str:
    """Commit that is checked out in a folder, with `CHANGED` where files were changed; empty where unknown.

    The commit of a folder inside a checkout, such as an environment, is unknown.
    """
    if not (folder / ".git").exists():
        return ""
    # a hook or an alias of the caller's own repository, whose variables are set, is not meant; nothing is written
    clean = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    command = ["git", "-C", str(folder), "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty"]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            timeout=_SECONDS_FOR_GIT,
            check=True,
            env={**clean, "GIT_OPTIONAL_LOCKS": "0"},
        )
    except (OSError, ValueError, subprocess.SubprocessError):
        return ""
    commit = done.stdout.strip()
    return commit.removesuffix("-dirty") + CHANGED if commit.endswith("-dirty") else commit


def _installed_from(text: str | None) -> Mapping[str, str]:
    """Commit, and public URL, of a package that was installed from a repository (PEP 610)."""
    try:
        found = json.loads(text or "{}")
        info, url = found.get("vcs_info"), found.get("url")
        if not isinstance(info, dict):
            return {}
        commit = info.get("commit_id")
    except (ValueError, AttributeError):
        return {}
    known = {"commit_id": commit, "url": url if isinstance(url, str) and url.startswith("https://") else ""}
    return {key: value for key, value in known.items() if isinstance(value, str)}
