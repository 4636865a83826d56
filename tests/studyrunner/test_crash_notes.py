"""Notes on crashes: counted once each, and never the way to another file."""

import os

import pytest

from studyrunner.mpi.crashes import count_crashes, forget_crashes, read_tally


def crash_text(key):
    return f'{key}\nFatal Python error: Aborted\n  File "x.py", line 1 in f\n  File "crashes.py", line 2 in noted\n'


@pytest.mark.parametrize("key", ["../precious", "f" * 32 + "/..", "F" * 32, "0" * 31])
def test_what_a_crash_says_of_its_task_leads_nowhere_else(key, tmp_path):
    folder = tmp_path / "out.nc.crashes"
    folder.mkdir()
    (folder / "rank-3.crash").write_text(crash_text(key))
    assert count_crashes(folder) == ()
    assert sorted(tmp_path.rglob("*")) == [folder]


def test_crashes_are_counted_once_each(tmp_path):
    for number in (1, 2):
        (tmp_path / "rank-3.crash").write_text(crash_text("a" * 32))
        assert [crash.key for crash in count_crashes(tmp_path, rank=3)] == ["a" * 32]
        assert count_crashes(tmp_path) == count_crashes(tmp_path, rank=3) == ()
        assert {key: len(crashes) for key, crashes in read_tally(tmp_path).items()} == {"a" * 32: number}
    forget_crashes(tmp_path, {"b" * 32})
    assert len(read_tally(tmp_path)) == 1
    forget_crashes(tmp_path, None)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("what", ["fifo", "folder", "endless", "link to nowhere"])
@pytest.mark.parametrize("name", ["rank-0.crash", f"{'0' * 32}.1.died"])
def test_only_plain_files_are_opened(what, name, tmp_path):
    odd = tmp_path / name
    if what == "fifo":
        os.mkfifo(odd)
    elif what == "folder":
        odd.mkdir()
    else:
        odd.symlink_to("/dev/zero" if what == "endless" else tmp_path / "none")
    assert (count_crashes(tmp_path), read_tally(tmp_path)) == ((), {})
    assert not (tmp_path / "none").exists()
