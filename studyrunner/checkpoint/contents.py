"""Values as compressed bytes: a text, the type and shape of some arrays, then the bytes of the arrays. No pickles.

Before compression the bytes of an array are sorted: all first bytes of its numbers, then all second bytes. Rows of
64-bit floats become differences from the row before, as integers and so without loss: slowly changing values become
zeros. zlib then makes the file of a study smaller than its result.

By hand: `numcodecs` sorts and compresses alike, as one more package with another format.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.packing import Packed

LARGEST = 9 * 10**8
"""Largest size of a value before compression, bytes. SQLite has no larger entries."""

_HEAD_BYTES = 8
_KINDS = frozenset("biufcSU")  # of numpy: numbers and texts, no objects


def compress(packed: Packed, level: int) -> tuple[int, bytes]:
    """Size before compression, and compressed bytes. level: of zlib, from 1 (fast) to 9.

    Raises TypeError for arrays of anything but numbers and texts: a bug.
    """
    for array in packed.arrays:
        if array.dtype.kind not in _KINDS:
            raise TypeError(f"arrays of {array.dtype} are not kept")
    head = json.dumps([packed.text, [[array.dtype.str, array.shape] for array in packed.arrays]]).encode()
    size = _HEAD_BYTES + len(head) + sum(array.nbytes for array in packed.arrays)
    stream = zlib.compressobj(level)
    pieces = [stream.compress(len(head).to_bytes(_HEAD_BYTES, "little") + head)]
    pieces += [stream.compress(sort_bytes(array)) for array in packed.arrays]
    return size, b"".join((*pieces, stream.flush()))


def decompress(size: int, content: bytes) -> Packed:
    """The value that was compressed. Raises ValueError where the bytes are no such value, or of another size."""
    if not 0 < size <= LARGEST:
        raise ValueError("larger than a run writes it")
    stream = zlib.decompressobj()
    try:
        raw = stream.decompress(content, size)
        if len(raw) != size or stream.decompress(stream.unconsumed_tail, 1) or not stream.eof:
            raise ValueError("another size than it says")
        first = _HEAD_BYTES + int.from_bytes(raw[:_HEAD_BYTES], "little")
        if first > size:
            raise ValueError("less than it says")
        text, layout = json.loads(raw[_HEAD_BYTES:first])
        if not isinstance(text, str):
            raise ValueError("no text")
        return Packed(text, tuple(_arrays_in(memoryview(raw)[first:], layout)))
    except (zlib.error, TypeError, RecursionError, OverflowError) as error:
        raise ValueError("not written by a run") from error


def _arrays_in(raw: memoryview, layout: Any) -> Iterator[NDArray[np.generic]]:
    for name, shape in layout:
        kind = np.dtype(str(name))
        if kind.kind not in _KINDS or any(type(length) is not int or length < 0 for length in shape):
            raise ValueError("not written by a run")
        n_bytes = kind.itemsize * math.prod(shape)
        if n_bytes > len(raw):
            raise ValueError("less than it says")
        yield join_bytes(np.frombuffer(raw[:n_bytes], np.uint8)[None], kind, tuple(shape)).reshape(shape)
        raw = raw[n_bytes:]
    if len(raw):
        raise ValueError("more than it says")


def sort_bytes(array: NDArray[np.generic]) -> bytes:
    """Bytes of an array of numbers or texts, byte place by byte place."""
    if _has_differences(array.dtype, array.shape):
        bits = np.asarray(array, order="C").view(np.uint64)
        array = np.concatenate([bits[:1], bits[1:] - bits[:-1]])
    return np.frombuffer(array.tobytes(), np.uint8).reshape(-1, _width(array.dtype)).T.tobytes()


def join_bytes(content: NDArray[np.uint8], kind: np.dtype[Any], shape: tuple[int, ...]) -> NDArray[np.generic]:
    """Arrays (n, *shape) from the bytes (n, n_bytes) of n outputs of `sort_bytes`."""
    places = content.reshape(len(content), _width(kind), -1).transpose(0, 2, 1)
    arrays = np.frombuffer(bytearray(places.tobytes()), kind).reshape(len(content), *shape)
    if _has_differences(kind, shape):
        arrays = np.add.accumulate(arrays.view("<u8"), axis=1).view(kind)
    return arrays


def _has_differences(kind: np.dtype[Any], shape: tuple[int, ...]) -> bool:
    return kind.str == "<f8" and len(shape) > 0 and shape[0] > 1


def _width(kind: np.dtype[Any]) -> int:
    """Number of bytes of a number; 1 for texts, which are not sorted."""
    return kind.itemsize if kind.kind in "fiuc" else 1
