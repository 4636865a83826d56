"""Packed files: the folder of a finished run takes about as much room as the result.

A run unpacks the files at the beginning and packs them at the end. Unpacked, records can be read from any place of a
file. A packed file has blocks of zlib, each with its length, and a check sum at the end. Before compression the bytes
of records are sorted: all values of a field together; the values of a history as differences from the output before;
all first bytes, then all second bytes. Slowly changing values become zeros. Differences are taken of the 64-bit
integers, without loss.
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
"""Ending of the name of a packed file."""

_LEVEL = 6
_LENGTH_BYTES = 8
_CHECK_SUM_BYTES = 4
_BYTES_A_BLOCK = 2**20


def packed_path(path: Path) -> Path:
    """Path of a file after packing."""
    return path.with_name(path.name + PACKED)


def unpacked_path(packed: Path) -> Path:
    """Path of a file before packing."""
    return packed.with_name(packed.name.removesuffix(PACKED))


def pack_records(file: IO[bytes], path: Path) -> None:
    """Packs a file of records. Raises ValueError where the records are damaged."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
    records = load_records(path)
    summed = Summed(file)
    write_header(summed, records.dtype, len(records))
    _write_blocks(summed, map(_sort_bytes, records_of([(path, range(len(records)))])))


def pack_file(file: IO[bytes], path: Path) -> None:
    """Packs a file without sorting bytes."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        _write_blocks(Summed(file), iter(lambda: source.read(_BYTES_A_BLOCK), b""))


def packed_kind(path: Path) -> np.dtype[Any]:
    """Type of the records in a packed file. Raises ValueError where damaged, OSError where unreadable."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        return read_header(source, LARGEST_PART)[0]


def unpack_records(file: IO[bytes], path: Path) -> None:
    """Unpacks a file of records. Raises ValueError where the file is damaged."""
    with open_plain(path, LARGEST_PART) as source:
        check_sum(source)
        kind, n_records = read_header(source, LARGEST_PART)
        blocks = _read_blocks(source, max(_BYTES_A_BLOCK, kind.itemsize))
        counts = (n_rows for _, n_rows in portions(n_records, kind))
        pieces = (_join_bytes(block, kind, n_rows) for block, n_rows in zip(blocks, counts, strict=True))
        write_pieces(file, kind, n_records, pieces)


def unpack_file(file: IO[bytes], path: Path) -> None:
    """Unpacks a file of `pack_file`. Raises ValueError where the file is damaged."""
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
    """Decompressed blocks. Raises ValueError where a block is damaged or has more than `largest` bytes."""
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
    """Bytes of records (n,), field by field and byte place by byte place."""
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
    """Records (n,) from sorted bytes. Raises ValueError where the number of bytes is wrong."""
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
    """Whether a field is a series of floating-point numbers."""
    return field.base.kind == "f" and field.base.itemsize == 8 and len(field.shape) > 0


def _width(base: np.dtype[Any]) -> int:
    """Number of bytes of a number; 1 for texts, which are not sorted."""
    return base.itemsize if base.kind in "fiu" else 1
