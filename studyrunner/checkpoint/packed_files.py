"""Files of a run's folder while no run is at work there: packed, so that they take no more room than the result.

A run unpacks them when it begins and packs them when it is finished; in between records are read from anywhere in a
file. A packed file holds blocks of zlib, each behind its length, and a check sum at its end. Records are sorted first:
the values of a field together, those of a history as differences from the output before, of all the first bytes, then
the second ones; what changes slowly is then mostly zeros. Differences are those of the 64 bits and lose nothing.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.checkpoint.part_files import (
    LARGEST_PART,
    Summed,
    check_sum,
    load_records,
    portions,
    read_header,
    records_of,
    write_header,
    write_pieces,
)
from studyrunner.system.files import open_plain

PACKED = ".z"
"""How the name of a packed file ends, after that of its sort."""

_LEVEL = 6
_LENGTH_BYTES = 8
_CHECK_SUM_BYTES = 4
_BYTES_A_BLOCK = 2**20


def packed_path(path: Path) -> Path:
    """Where a file stands once it is packed."""
    return path.with_name(path.name + PACKED)


def unpacked_path(packed: Path) -> Path:
    """Where a packed file stood before."""
    return packed.with_name(packed.name.removesuffix(PACKED))


def pack_records(file: IO[bytes], path: Path) -> None:
    """Writes the records of a file into a packed one. Raises ValueError where they are damaged."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
    records = load_records(path)
    summed = Summed(file)
    write_header(summed, records.dtype, len(records))
    _write_blocks(summed, map(_sort_bytes, records_of([(path, range(len(records)))])))


def pack_file(file: IO[bytes], path: Path) -> None:
    """Writes a file as it is into a packed one."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        _write_blocks(Summed(file), iter(lambda: source.read(_BYTES_A_BLOCK), b""))


def packed_kind(path: Path) -> np.dtype[Any]:
    """Type of the records in a packed file. Raises ValueError where it is damaged, OSError where it cannot be read."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        return read_header(source, LARGEST_PART)[0]


def unpack_records(file: IO[bytes], path: Path) -> None:
    """Writes the records of a packed file as they were. Raises ValueError where it is damaged."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        kind, n_records = read_header(source, LARGEST_PART)
        blocks = _read_blocks(source, max(_BYTES_A_BLOCK, kind.itemsize))
        counts = (n_rows for _, n_rows in portions(n_records, kind))
        pieces = (_join_bytes(block, kind, n_rows) for block, n_rows in zip(blocks, counts, strict=True))
        write_pieces(file, kind, n_records, pieces)


def unpack_file(file: IO[bytes], path: Path) -> None:
    """Writes what was packed by `pack_file` as it was. Raises ValueError where it is damaged."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        for block in _read_blocks(source, _BYTES_A_BLOCK):
            if file.write(block) and file.tell() > LARGEST_PART:
                raise ValueError("more than a run writes into a file")


def _write_blocks(summed: Summed, blocks: Iterable[bytes]) -> None:
    for block in blocks:
        packed = zlib.compress(block, _LEVEL)
        summed.write(len(packed).to_bytes(_LENGTH_BYTES, "little"))
        summed.write(packed)
    summed.end()


def _read_blocks(source: IO[bytes], largest: int) -> Iterator[bytes]:
    """Blocks as they were. Raises ValueError where one is damaged or has more than `largest` bytes."""
    end = os.fstat(source.fileno()).st_size - _CHECK_SUM_BYTES
    while source.tell() < end:
        length = int.from_bytes(source.read(_LENGTH_BYTES), "little")
        if length > end - source.tell():
            raise ValueError("a block is longer than its file")
        unpack = zlib.decompressobj()
        try:
            block = unpack.decompress(source.read(length), largest + 1)
        except zlib.error as error:
            raise ValueError("a block cannot be unpacked") from error
        if not unpack.eof or len(block) > largest:
            raise ValueError("a block is larger than any that was written")
        yield block


def _sort_bytes(records: NDArray[np.void]) -> bytes:
    """Fields of records (n,), one after the other, each by places of its bytes."""
    parts = []
    for name in records.dtype.names or ():
        values = np.ascontiguousarray(records[name])
        if _has_differences(records.dtype[name]):
            bits = values.view("<u8")
            values = bits.copy()
            values[:, 1:] -= bits[:, :-1]
        parts.append(np.frombuffer(values.tobytes(), np.uint8).reshape(-1, _width(values.dtype)).T.tobytes())
    return b"".join(parts)


def _join_bytes(content: bytes, kind: np.dtype[np.void], n_records: int) -> NDArray[np.void]:
    """Records (n,) of sorted bytes. Raises ValueError where these are too few or too many."""
    if len(content) != n_records * kind.itemsize:
        raise ValueError("a block has another length than it says")
    records, first = np.zeros(n_records, kind), 0
    for name in kind.names or ():
        field = kind[name]
        base, last = field.base, first + n_records * field.itemsize
        places = np.frombuffer(content[first:last], np.uint8).reshape(_width(base), -1)
        values = np.frombuffer(places.T.tobytes(), base).reshape(n_records, *field.shape)
        if _has_differences(field):
            values = np.add.accumulate(values.view("<u8"), axis=1).view(base)
        records[name], first = values, last
    return records


def _has_differences(field: np.dtype[Any]) -> bool:
    """Whether a field is a series of floating numbers."""
    return field.base.kind == "f" and field.base.itemsize == 8 and len(field.shape) > 0


def _width(base: np.dtype[Any]) -> int:
    """Bytes of a number; texts are sorted as they are."""
    return base.itemsize if base.kind in "fiu" else 1
