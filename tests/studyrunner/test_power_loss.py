"""What is said to be on the disk is there after a loss of power: names and contents that were synced, and no others."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import IO

import numpy as np
import pytest

from studyrunner.checkpoint import part_writer
from studyrunner.checkpoint.store import Store
from studyrunner.system import files
from tests.studyrunner.test_store import KIND, assert_same, kept, key, record


class Disk:
    """A folder, and what of it would be there after a loss of power: a log of its syncs.

    A file has the content that it had when it was synced last; a name is what it was when the folder was synced last.
    """

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder = folder
        self.log: list[str] = []
        self.contents: dict[int, bytes] = {}
        self.names: dict[str, int] = {}
        self.watch = lambda: None
        own_create, own_sync, own_sync_folder, own_replace = files.create, files.sync, files.sync_folder, os.replace

        def create(path: Path) -> IO[bytes]:
            file = own_create(path)
            # the number may be that of a file that was removed
            self.contents.pop(os.fstat(file.fileno()).st_ino, None)
            return file

        def sync(file: IO[bytes]) -> None:
            own_sync(file)
            number = os.fstat(file.fileno()).st_ino
            self.contents[number] = Path(f"/proc/self/fd/{file.fileno()}").read_bytes()
            self.log.append("file")
            self.watch()

        def sync_folder(path: Path) -> None:
            own_sync_folder(path)
            if path == self.folder:
                self.names = {found.name: found.stat().st_ino for found in path.iterdir()}
                self.log.append("folder")
            self.watch()

        def replace(source: Path, target: Path) -> None:
            own_replace(source, target)
            self.log.append(f"rename {target.suffix}")
            self.watch()

        monkeypatch.setattr(files, "create", create)
        monkeypatch.setattr(files, "sync", sync)
        monkeypatch.setattr(files, "sync_folder", sync_folder)
        monkeypatch.setattr(part_writer.os, "replace", replace)

    def after_power_loss(self, folder: Path, *, names_of_now: bool) -> Path:
        """What is there then. names_of_now: the disk had taken note of the names, but not of the contents."""
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        now = {found.name: found.stat().st_ino for found in self.folder.iterdir()}
        for name, number in (now if names_of_now else self.names).items():
            if name != "lock":
                (folder / name).write_bytes(self.contents.get(number, b""))
        return folder


@pytest.mark.slow
@pytest.mark.parametrize("names_of_now", [False, True])
def test_nothing_that_was_said_to_be_there_is_lost(
    names_of_now: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The power fails after each sync and each renaming of a run that writes, replaces, merges and removes."""
    disk = Disk(tmp_path / "parts", monkeypatch)
    store = Store(disk.folder, KIND)
    known: dict[str, int] = {}
    progress: dict[str, int] = {}
    n_losses = 0

    def lose_power() -> None:
        nonlocal n_losses
        n_losses += 1
        with monkeypatch.context() as quiet:
            # the store that looks at what is left is no part of what is watched
            quiet.setattr(disk, "watch", lambda: None)
            names, log = dict(disk.names), list(disk.log)
            left = Store(disk.after_power_loss(tmp_path / "left", names_of_now=names_of_now), KIND)
            histories = dict(left.histories)
            for name, version in known.items():
                number, row = histories[name]
                expected = record(version)
                expected["key"] = name.encode()
                assert left.read(number)[row].tobytes() == expected[0].tobytes()
                assert_same(left.read_start(name), kept(version))
            for task, version in progress.items():
                found = left.read_progress(task)
                assert found is not None
                assert found.text in (kept(version).text, kept(version + 1).text)
            left.close()
            disk.names, disk.log = names, log

    disk.watch = lose_power
    for number in range(25):
        store.add_history(key(number), record(number))
        store.add_start(key(number), kept(number))
        store.keep_progress(key(100), kept(number))
        store.flush()
        known[key(number)] = number
        progress[key(100)] = number
    # ten files became one in the meantime
    assert len(list(disk.folder.glob("*.npy"))) < 15
    before = n_losses
    store.pack()
    store.close()
    assert {path.suffix for path in disk.folder.iterdir()} == {".z", ""}
    assert n_losses > before + 3 * 3
    Store(disk.folder, KIND).close()
    assert ".z" not in {path.suffix for path in disk.folder.iterdir()}
    disk.watch = lambda: None
    assert n_losses > 25 * 7
    assert disk.log[:6] == ["file", "rename .starts", "file", "rename .npy", "file", "rename .progress"]
    assert disk.log[6] == "folder"


def test_the_result_is_on_the_disk_before_anything_is_removed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    log: list[str] = []
    fsync, replace = os.fsync, os.replace

    def note_sync(number: int) -> None:
        log.append(f"sync {Path(f'/proc/self/fd/{number}').readlink().suffix}")
        fsync(number)

    def note_replace(source: Path, target: Path) -> None:
        log.append("rename")
        replace(source, target)

    monkeypatch.setattr(files.os, "fsync", note_sync)
    monkeypatch.setattr(files.os, "replace", note_replace)
    target = tmp_path / "out.nc"
    with files.replacing(target) as partial:
        np.save(partial, np.zeros(3))
        Path(f"{partial}.npy").replace(partial)
        log.clear()
    assert log == ["sync .partial", "rename", "sync "]


def test_a_new_folder_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[Path] = []
    from studyrunner.checkpoint import store as store_module

    monkeypatch.setattr(store_module, "sync_folder", synced.append)
    Store(tmp_path / "parts", KIND).close()
    assert synced == [tmp_path]
