"""Formats of the files in the folder of a run: records of histories, and bundles of start states or of progress.

Records are one array of numpy with an element for each history. A bundle has three parts: the keys of its entries, the
end of each entry, and the entries. An entry is some arrays of numpy; the first array is a text. No file contains a
pickle. A check sum at the end shows whether a file is undamaged.
"""

from __future__ import annotations

import io
import os
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from solver.packing import Packed
from studyrunner.system.files import open_plain

KEY = "key"
"""Name of the field of a record with the hash of the history."""

KEY_TYPE = "S32"

LARGEST_PART = 2**32
"""Largest size of a file in the folder, bytes."""

_CHECK_SUM_BYTES = 4
_BYTES_AT_ONCE = 2**20

Rows = Sequence[int]
"""Rows of entries in a file."""


class Summed:
    """An open file with the check sum of what was written so far."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._sum = 0

    def write(self, content: bytes | memoryview) -> int:
        """Writes bytes."""
        self._sum = zlib.crc32(content, self._sum)
        return self._file.write(content)

    def end(self) -> None:
        """Writes the check sum."""
        self._file.write(self._sum.to_bytes(_CHECK_SUM_BYTES, "little"))


def write_records(file: IO[bytes], pieces: Sequence[NDArray[np.void]]) -> None:
    """Writes records (n,) of one type, piece by piece."""
    write_pieces(file, pieces[0].dtype, sum(map(len, pieces)), pieces)


def load_records(path: Path) -> NDArray[np.void]:
    """Records that stay on the disk until they are used; the check sum is not tested.

    Raises
    ------
    ValueError
        Where the file contains no records.
    OSError
        Where the file cannot be read.
    """
    with open_plain(path, LARGEST_PART) as file:
        kind, n_records = _read_record_header(file)
        return np.memmap(file, kind, "r", file.tell(), (n_records,))


def load_record_keys(path: Path) -> tuple[np.dtype[np.void], list[str]]:
    """Type of the records of a file, and their hashes. Reads the file in pieces and tests the check sum.

    Raises
    ------
    ValueError
        Where the file is damaged.
    OSError
        Where the file cannot be read.
    """
    with open_plain(path, LARGEST_PART) as file:
        check_sum(file)
        kind, n_records = _read_record_header(file)
        keys: list[str] = []
        for _, n_rows in portions(n_records, kind):
            records = np.frombuffer(file.read(n_rows * kind.itemsize), kind)
            keys += [_text(key) for key in records[KEY].tolist()]
    return kind, keys


def merge_records(file: IO[bytes], sources: Sequence[tuple[Path, Rows]]) -> None:
    """Writes records of several files of one type into a new file."""
    for path, _ in sources:
        with open_plain(path, LARGEST_PART) as source:
            check_sum(source)
    kind = load_records(sources[0][0]).dtype
    write_pieces(file, kind, sum(len(rows) for _, rows in sources), records_of(sources))


def records_of(sources: Sequence[tuple[Path, Rows]]) -> Iterator[NDArray[np.void]]:
    """Records of several files, piece by piece."""
    for path, rows in sources:
        # each piece from the file anew: what was used of it once does not stay in memory
        for first, n_rows in portions(len(rows), load_records(path).dtype):
            yield load_records(path)[list(rows[first : first + n_rows])]


def write_bundle(file: IO[bytes], entries: Mapping[str, Packed]) -> None:
    """Writes entries with their keys."""
    contents = [_as_bytes(entry) for entry in entries.values()]
    _write_entries(file, list(entries), list(map(len, contents)), contents)


def load_keys(path: Path) -> list[str]:
    """Keys of a bundle. Raises ValueError where the bundle is damaged, OSError where it cannot be read."""
    with open_plain(path, LARGEST_PART) as file:
        check_sum(file)
        return list(_Contents.of(file).keys)


def read_entry(path: Path, place: int) -> Packed:
    """An entry of a bundle. Raises ValueError where the entry is damaged, OSError where it cannot be read."""
    with open_plain(path, LARGEST_PART) as file:
        return _from_bytes(_Contents.of(file).read(file, place))


def merge_bundles(file: IO[bytes], sources: Sequence[tuple[Path, Rows]]) -> None:
    """Writes entries of several bundles into a new bundle."""
    keys: list[str] = []
    lengths: list[int] = []
    for path, rows in sources:
        with open_plain(path, LARGEST_PART) as source:
            check_sum(source)
            contents = _Contents.of(source)
            keys += [contents.keys[row] for row in rows]
            lengths += [contents.ends[row] - contents.begins[row] for row in rows]
    _write_entries(file, keys, lengths, _entries_of(sources))


def _entries_of(sources: Sequence[tuple[Path, Rows]]) -> Iterator[bytes]:
    """Entries of several bundles, one in memory at a time."""
    for path, rows in sources:
        with open_plain(path, LARGEST_PART) as source:
            contents = _Contents.of(source)
            yield from (contents.read(source, row) for row in rows)


@dataclass(frozen=True)
class _Contents:
    """Head of a bundle: keys, and begin and end of each entry in the file."""

    keys: tuple[str, ...]
    begins: tuple[int, ...]
    ends: tuple[int, ...]

    @classmethod
    def of(cls, file: IO[bytes]) -> _Contents:
        keys, ends = _read_column(file, KEY_TYPE), _read_column(file, "<i8")
        first, left = file.tell(), os.fstat(file.fileno()).st_size - file.tell() - _CHECK_SUM_BYTES
        lengths = np.diff(ends, prepend=0)
        if len(keys) != len(ends) or not len(ends) or (lengths < 0).any() or ends[-1] != left:
            raise ValueError("the bundle has other entries than it says")
        begins = first + ends - lengths
        return cls(tuple(map(_text, keys.tolist())), tuple(begins.tolist()), tuple((first + ends).tolist()))

    def read(self, file: IO[bytes], place: int) -> bytes:
        file.seek(self.begins[place])
        return file.read(self.ends[place] - self.begins[place])


def _write_entries(file: IO[bytes], keys: Sequence[str], lengths: Sequence[int], entries: Iterable[bytes]) -> None:
    summed = Summed(file)
    for column in (np.array(keys, KEY_TYPE), np.cumsum(lengths, dtype="<i8")):
        write_header(summed, column.dtype, len(column))
        summed.write(column.tobytes())
    for entry in entries:
        summed.write(entry)
    summed.end()


def _as_bytes(entry: Packed) -> bytes:
    buffer = io.BytesIO()
    for array in (np.frombuffer(entry.text.encode(), np.uint8), *entry.arrays):
        npy.write_array(buffer, np.asanyarray(array), allow_pickle=False)
    return buffer.getvalue()


def _from_bytes(content: bytes) -> Packed:
    text, *arrays = _arrays_in(content)
    return Packed(text.tobytes().decode(), tuple(arrays))


def _arrays_in(content: bytes) -> Iterator[NDArray[np.generic]]:
    buffer = io.BytesIO(content)
    while buffer.tell() < len(content):
        yield npy.read_array(buffer, allow_pickle=False)


def write_header(file: Summed, kind: np.dtype[np.generic], length: int) -> None:
    """Writes type and length of a one-dimensional array, whose elements follow."""
    header = {"descr": npy.dtype_to_descr(kind), "fortran_order": False, "shape": (length,)}
    npy.write_array_header_1_0(file, header)


def read_header(file: IO[bytes], largest: int = 0) -> tuple[np.dtype[Any], int]:
    """Type and length of a one-dimensional array.

    Raises ValueError where the array is larger than the file or than `largest`.
    """
    if npy.read_magic(file) != (1, 0):
        raise ValueError("not written by a run")
    shape, _, kind = npy.read_array_header_1_0(file)
    largest = largest or os.fstat(file.fileno()).st_size
    if len(shape) != 1 or kind.hasobject or not 0 < kind.itemsize * shape[0] <= largest:
        raise ValueError("not written by a run")
    return kind, shape[0]


def _read_column(file: IO[bytes], expected: str) -> NDArray[np.generic]:
    kind, length = read_header(file)
    if kind != np.dtype(expected):
        raise ValueError("not written by a run")
    return np.frombuffer(file.read(kind.itemsize * length), kind)


def check_sum(file: IO[bytes]) -> None:
    """Tests the check sum of a file; the position in the file is unchanged. Raises ValueError where it is wrong."""
    before = file.tell()
    file.seek(0)
    left, found = os.fstat(file.fileno()).st_size - _CHECK_SUM_BYTES, 0
    while left > 0 and (some := file.read(min(left, _BYTES_AT_ONCE))):
        found, left = zlib.crc32(some, found), left - len(some)
    if found.to_bytes(_CHECK_SUM_BYTES, "little") != file.read():
        raise ValueError("the check sum is another one")
    file.seek(before)


def write_pieces(file: IO[bytes], kind: np.dtype[np.void], n_records: int, pieces: Iterable[NDArray[np.void]]) -> None:
    """Writes a file of n_records records, which come in pieces."""
    summed = Summed(file)
    write_header(summed, kind, n_records)
    for piece in pieces:
        for first, n_rows in portions(len(piece), kind):
            summed.write(piece[first : first + n_rows].tobytes())
    summed.end()


def portions(n_records: int, kind: np.dtype[np.void]) -> Iterator[tuple[int, int]]:
    """First record and number of records of portions that are read at once."""
    step = max(1, _BYTES_AT_ONCE // kind.itemsize)
    return ((first, min(step, n_records - first)) for first in range(0, n_records, step))


def _read_record_header(file: IO[bytes]) -> tuple[np.dtype[Any], int]:
    """Type and number of the records that follow. Raises ValueError where the file has another length."""
    kind, n_records = read_header(file)
    if file.tell() + n_records * kind.itemsize + _CHECK_SUM_BYTES != os.fstat(file.fileno()).st_size:
        raise ValueError("the file has another length than it says")
    return kind, n_records


def _text(key: bytes) -> str:
    return key.decode("ascii")
