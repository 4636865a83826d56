"""The folder of a finished run: packed, no larger than the result, and as it was when it is unpacked."""

from __future__ import annotations

import errno
import io
import itertools
import shutil
import zlib
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studyrunner.checkpoint import part_writer
from studyrunner.checkpoint.packed_files import pack_file, pack_records, unpack_file, unpack_records
from studyrunner.checkpoint.part_files import KEY, KEY_TYPE, write_bundle, write_records
from studyrunner.checkpoint.store import Store
from studyrunner.cli import main
from tests.studyrunner.faked_runs import SMALL, Solver
from tests.studyrunner.test_store import KIND, assert_same, fill, kept, key, names, record, records_of

WIDE = np.dtype(
    [
        (KEY, KEY_TYPE, ()),
        ("outcome", "int8", ()),
        ("run_time", "float64", ()),
        ("depth", "float64", (3, 2)),
        ("loop", "float64", (2, 1, 3)),
        ("harmonics", "int32", (3,)),
        ("message", "U7", ()),
    ]
)


def repacked(path: Path, content: bytes, pack: object, unpack: object) -> bytes:
    assert callable(pack)
    assert callable(unpack)
    path.write_bytes(content)
    packed = path.with_name("packed")
    with packed.open("wb") as file:
        pack(file, path)
    again = io.BytesIO()
    unpack(again, packed)
    return again.getvalue()


@given(st.binary(min_size=WIDE.itemsize, max_size=WIDE.itemsize), st.integers(1, 5))
def test_records_come_back_to_the_last_bit(tmp_path_factory: pytest.TempPathFactory, content: bytes, n: int) -> None:
    """Whatever their bits are: NaN with a payload, infinity, -0, texts that are none."""
    records = np.frombuffer(content * n, WIDE)
    file = io.BytesIO()
    write_records(file, [records])
    path = tmp_path_factory.getbasetemp() / "records"
    assert repacked(path, file.getvalue(), pack_records, unpack_records) == file.getvalue()


def test_many_blocks_come_back(tmp_path: Path) -> None:
    """Records of several blocks, and one that is larger than a block."""
    rng = np.random.default_rng(1)
    for n_values, n_records in ((5, 70_000), (300_000, 3)):
        kind = np.dtype([(KEY, KEY_TYPE, ()), ("values", "float64", (n_values,))])
        records = np.zeros(n_records, kind)
        records["values"] = rng.standard_normal((n_records, n_values))
        file = io.BytesIO()
        write_records(file, [records])
        assert repacked(tmp_path / "f", file.getvalue(), pack_records, unpack_records) == file.getvalue()
    file = io.BytesIO()
    write_bundle(file, {key(number): kept(number) for number in range(2000)})
    assert repacked(tmp_path / "f", file.getvalue(), pack_file, unpack_file) == file.getvalue()


def pack(folder: Path, kind: np.dtype[np.void] = KIND) -> None:
    store = Store(folder, kind)
    store.pack()
    store.close()


def test_what_was_packed_is_there_in_a_later_run(tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    fill(folder)
    store = Store(folder, KIND)
    before = records_of(store)
    store.add_start(key(7), kept(7))
    store.keep_progress(key(8), kept(8))
    store.flush()
    store.pack()
    store.close()
    assert all(name == "lock" or name.endswith(".z") for name in names(folder))
    again = Store(folder, KIND)
    assert records_of(again) == before
    assert_same(again.read_start(key(7)), kept(7))
    found = again.read_progress(key(8))
    assert found is not None
    assert_same(found, kept(8))
    newer = record(9)
    newer["key"] = key(0).encode()
    again.add_history(key(0), newer)
    again.close()
    # what is later counts, also after both were packed
    pack(folder)
    last = Store(folder, KIND)
    number, row = last.histories[key(0)]
    assert last.read(number)[row]["values"].tolist() == record(9)[0]["values"].tolist()
    last.close()
    assert last.notes == []


def test_records_of_another_study_stay_packed(tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    fill(folder)
    pack(folder)
    packed = {path: path.read_bytes() for path in folder.glob("*.npy.z")}
    assert packed
    pack(folder, WIDE)
    assert {path: path.read_bytes() for path in packed} == packed
    store = Store(folder, WIDE)
    assert store.histories == {}
    store.prune((), (), (), 0.0)
    store.close()
    assert not any(path.exists() for path in packed)


def test_a_kill_between_writing_and_removing_is_no_harm(tmp_path: Path) -> None:
    folder, both = tmp_path / "parts", tmp_path / "both"
    fill(folder)
    shutil.copytree(folder, both)
    # its name is there, but its room is that of another file by now
    next(both.glob("*.starts")).write_bytes(b"")
    store = Store(folder, KIND)
    before = records_of(store)
    store.pack()
    store.close()
    for path in folder.glob("*.z"):
        shutil.copy(path, both)
    (both / "00000001-0123456789ab.npy.z.partial").write_bytes(b"half")
    again = Store(both, KIND)
    assert records_of(again) == before
    assert again.notes == []
    again.close()
    assert not list(both.glob("*.z*"))


@pytest.mark.parametrize("damage", ["a byte", "an end", "nothing in it"])
def test_what_is_damaged_is_computed_again(damage: str, tmp_path: Path) -> None:
    folder = tmp_path / "parts"
    fill(folder)
    pack(folder)
    path = max(folder.glob("*.npy.z"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes({"a byte": content, "an end": content[:-9], "nothing in it": b""}[damage])
    store = Store(folder, KIND)
    assert store.notes == [f"parts: {path.name} is damaged, what it held is computed again"]
    store.close()
    assert not path.exists()
    assert not list(folder.glob("*.partial"))


def test_no_block_is_unpacked_to_any_size(tmp_path: Path) -> None:
    block = zlib.compress(bytes(2**24))
    body = len(block).to_bytes(8, "little") + block
    path = tmp_path / "00000001.starts.z"
    path.write_bytes(body + zlib.crc32(body).to_bytes(4, "little"))
    with pytest.raises(ValueError, match="larger than any that was written"):
        unpack_file(io.BytesIO(), path)


def test_without_room_files_stay_as_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "parts"
    fill(folder)
    store = Store(folder, KIND)
    before = records_of(store)

    def full(file: IO[bytes], _: Path) -> None:
        file.write(b"some")
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(part_writer, "pack_records", full)
        store.pack()
    store.close()
    assert not list(folder.glob("*.partial"))
    again = Store(folder, KIND)
    assert records_of(again) == before
    again.close()


def folder_bytes(result: str) -> tuple[int, int]:
    parts = sum(path.stat().st_size for path in Path(f"{result}.parts").iterdir())
    return parts, Path(result).stat().st_size


@pytest.mark.usefixtures("reader", "folder")
def test_a_run_that_is_finished_packs_and_goes_on_from_it(solver: Solver) -> None:
    assert main(SMALL) == 0
    assert not list(Path("out.nc.parts").glob("*.npy"))
    assert list(Path("out.nc.parts").glob("*.npy.z"))
    first = folder_bytes("out.nc")
    assert first[0] <= first[1]
    solver.begin_again()
    more = [*SMALL, "--set", "axes.wear_coefficient=[5e-12, 1e-11, 3e-11]"]
    assert main(more) == 0
    assert 0 < solver.n_results <= 4
    for command, arguments in itertools.product((more, SMALL), ([], ["--retry-failed"])):
        solver.begin_again()
        assert main([*command, *arguments]) == 0
        assert solver.n_results == 0
    assert main([*SMALL, "--fresh"]) == 0
    assert solver.n_results == 6


@pytest.mark.usefixtures("reader", "folder", "solver")
def test_an_ending_while_files_are_packed_is_none_of_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    def end(_: Store) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Store, "pack", end)
        assert main(SMALL) == 0
    assert not list(Path("out.nc.parts").glob("*.z"))
    assert main(SMALL) == 0
    assert list(Path("out.nc.parts").glob("*.z"))


@pytest.mark.slow
@pytest.mark.usefixtures("reader", "folder")
@pytest.mark.parametrize("study", ["sdof_slider", "two_masses"])
def test_the_folder_is_no_larger_than_the_result(study: str) -> None:
    """Of true histories, whose numbers are less even than those of the stand-in."""
    few = ("axes.scheme=adaptive", "slow_time.outputs=51", "outputs.loops=[0]")
    options = [part for text in few for part in ("--set", text)]
    assert main([study, *options, "-o", "out.nc"]) in (0, 3)
    parts, result = folder_bytes("out.nc")
    assert parts <= result
    assert not list(Path("out.nc.parts").glob("*.progress*"))
