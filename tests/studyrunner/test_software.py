"""Commit and URL of the software in a result: only where they are known, and no trouble where they are not."""

import json
import subprocess
from importlib import metadata

import netCDF4
import pytest

from studyrunner.cli import main
from studyrunner.result import software
from studyrunner.result.software import CHANGED, commit_of, describe_software
from tests.studyrunner.faked_runs import SMALL

WHO = ("-c", "user.name=a", "-c", "user.email=b")
URL, GIT = "https://b.example/r", {"vcs": "git", "commit_id": "a" * 40}


def git(folder, *arguments):
    done = subprocess.run(["git", "-C", str(folder), *WHO, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", "/dev/null")
    folder = tmp_path / "checkout"
    folder.mkdir()
    git(folder, "init", "-q")
    (folder / "a.py").write_text("one", encoding="utf-8")
    git(folder, "add", "a.py")
    git(folder, "commit", "-qm", "one")
    return folder


def test_the_commit_is_that_of_git(checkout):
    head = git(checkout, "rev-parse", "HEAD")
    assert len(head) == 40
    assert commit_of(checkout) == head
    git(checkout, "tag", "-a", "v1", "-m", "a name is no commit")
    assert commit_of(checkout) == head
    (checkout / "a.py").write_text("two", encoding="utf-8")
    assert commit_of(checkout) == head + CHANGED
    git(checkout, "commit", "-qam", "two")
    assert commit_of(checkout) == git(checkout, "rev-parse", "HEAD") != head
    tree = checkout.parent / "tree"
    git(checkout, "worktree", "add", "-q", str(tree), head)
    assert commit_of(tree) == head


@pytest.mark.parametrize(
    ("direct_url", "expected"),
    [
        (None, {}),
        ("no json", {}),
        ("[1]", {}),
        (json.dumps({"url": "file:///home/me", "dir_info": {"editable": True}}), {}),
        (json.dumps({"url": URL, "vcs_info": GIT}), {"software_commit": "a" * 40}),
        (json.dumps({"url": 3, "vcs_info": {"commit_id": 4}}), {}),
    ],
)
def test_a_package_from_a_repository_says_its_commit(direct_url, expected, tmp_path, monkeypatch):
    about = tmp_path / "tool-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: tool\nVersion: 1\n", encoding="utf-8")
    if direct_url is not None:
        (about / "direct_url.json").write_text(direct_url, encoding="utf-8")
    monkeypatch.setattr(metadata, "distribution", lambda _: metadata.Distribution.at(about))
    monkeypatch.setattr(metadata, "metadata", lambda _: metadata.Distribution.at(about).metadata)
    monkeypatch.setattr(software, "commit_of", lambda _: "")
    assert describe_software("tool") == expected


@pytest.mark.usefixtures("folder")
def test_it_stands_in_the_result_and_is_no_part_of_it(solver, monkeypatch):
    found = []
    there = {"software_url": URL, "software_commit": "b" * 40}
    for known in ({}, there):
        monkeypatch.setattr("studyrunner.run.describe_software", lambda _, known=known: known)
        assert main(SMALL) == 0
        with netCDF4.Dataset("out.nc") as file:
            found.append({name: file.getncattr(name) for name in file.ncattrs()})
        n_results = solver.n_results
    assert found[1] == found[0] | there
    assert n_results == 6
