"""Study, scene and result files that were made to do harm."""

import contextlib
import os
import zlib
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from tests.studies.scene_models import put
from tests.studies.test_wrong_scene_files import attribute, circle, virtual

STUDY = """
[study]
name = "s"
[scene]
model = "scene.h5"
friction_coefficient = 0.5
[axes]
frequency = [150.0]
[slow_time]
cycles = 0
outputs = 1
"""

Change = Callable[[h5py.File], None]


def replaced(key: str, shape: tuple[int, ...], dtype: object = "f8", **options: object) -> Change:
    """A dataset that declares a shape and holds nothing."""

    def change(file: h5py.File) -> None:
        del file[key]
        file.create_dataset(key, shape, dtype, **options)

    return change


def linked(link: object) -> Change:
    def change(file: h5py.File) -> None:
        del file["mass"]
        file["mass"] = link

    return change


def endless_links(file: h5py.File) -> None:
    file["a"] = h5py.SoftLink("/b")
    file["b"] = h5py.SoftLink("/a")


def references(file: h5py.File) -> None:
    put("mass", np.array([[file["contact"].ref]], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)(file)


def many_objects(file: h5py.File) -> None:
    for number in range(5000):
        file.create_group(f"g{number}")


def deep_groups(file: h5py.File) -> None:
    group = file
    for _ in range(500):
        group = group.create_group("g")


def inflating_chunk(file: h5py.File) -> None:
    """A chunk that says 8 bytes and unpacks to 4 GB, as the library does not stop where its chunk is full."""
    del file["mass"]
    mass = file.create_dataset("mass", (1, 1), "f8", chunks=(1, 1), compression="gzip")
    packer = zlib.compressobj(9)
    # a block that depends on none before it can stand there any number of times
    head, block = (packer.compress(bytes(2**20)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    packed = head + 4095 * block
    mass.id.write_direct_chunk((0, 0), packed)


def stacked_filters(file: h5py.File) -> None:
    del file["mass"]
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((1, 1))
    for _ in range(5):
        properties.set_deflate(9)
    h5py.h5d.create(file.id, b"mass", h5py.h5t.IEEE_F64LE, h5py.h5s.create_simple((1, 1)), properties)


def named(name: str) -> Change:
    def change(file: h5py.File) -> None:
        file.create_dataset(name, data=np.ones(1))

    return change


def long_texts(file: h5py.File) -> None:
    del file["contact/surface"]
    text = h5py.string_dtype("utf-8")
    file.create_dataset("contact/surface", data=["x" * 10**7], dtype=text)


SCENES: dict[str, Change] = {
    "bomb within the limit": replaced("stiffness", (2800, 2800), chunks=(1000, 1000), compression="gzip"),
    "denormal area": put("contact/area", [-5e-324]),
    "huge matrix": replaced("mass", (10**7, 10**7), chunks=(100, 100)),
    "bomb of zeros": replaced("stiffness", (40000, 40000), chunks=(1000, 1000), compression="gzip"),
    "64 bit overflow": replaced("mass", (2**33, 2**33), chunks=(64, 64)),
    "inflating chunk": inflating_chunk,
    "stacked filters": stacked_filters,
    "chunk of gigabytes": replaced("mass", (20000, 20000), maxshape=(None, None), chunks=(20000, 20000)),
    "external link": linked(h5py.ExternalLink("/etc/passwd", "/")),
    "endless soft links": endless_links,
    "circle of groups": circle,
    "many objects": many_objects,
    "deep groups": deep_groups,
    "external storage": replaced("mass", (1, 1), external=[("/dev/zero", 0, 8)]),
    "virtual dataset": virtual,
    "references": references,
    "ragged rows": replaced("mass", (1, 1), h5py.vlen_dtype(np.float64)),
    "objects": replaced("mass", (1, 1), h5py.string_dtype()),
    "array type": replaced("mass", (1,), np.dtype(("f8", (10**4,)))),
    "name with an escape sequence": named("\x1b[2J\x1b]0;owned\x07"),
    "label with an escape sequence": put("response/names", ["\x1b[31mred", "\x1b[31mred"]),
    "not a number": put("stiffness", [[np.nan]]),
    "next to the largest": put("stiffness", [[1.7e308]]),
    "wrong byte order": put("contact/dofs", np.array([[-1, 0, -1]]).astype(">i4").view("<i4")),
    "long texts": long_texts,
    "attribute of text": attribute("nodal_diameter", "\x1b[2J"),
    "huge number of sectors": attribute("n_sectors", 2**62),
}
"""Changes of the scene file of the slider."""

ALLOWED = {"next to the largest"}
"""Those that may as well be a scene."""

_S = STUDY.encode()

TEXTS: dict[str, bytes] = {
    "scene with a long name": _S.replace(b"scene.h5", b"x" * 5000 + b".h5"),
    "huge hexadecimal": _S.replace(b"[150.0]", b"0x" + b"f" * 1_000_000),
    "escape sequence in a key": _S + b'"\\u001b]0;owned\\u0007" = 1\n',
    "nested arrays": b"a = " + b"[" * 100_000,
    "nested arrays as a value": _S + b"step = " + b"[" * 400 + b"]" * 400,
    "dotted key": b".".join([b"a"] * 200_000) + b" = 1",
    "many dotted keys": b"".join(b"a.b%d.c.d.e.f = 1\n" % n for n in range(40_000)),
    "huge integer": _S + b"x = " + b"9" * 100_000,
    "huge exponent": _S.replace(b"[150.0]", b"1e999999999"),
    "long string": b'[study]\nname = "' + b"x" * 3_000_000 + b'"',
    "array of tables": b"[[study]]\n" * 300_000,
    "too long": b"#" * 200_000_000,
    "random bytes": np.random.default_rng(0).bytes(100_000),
    "escape sequence": _S.replace(b"cycles = 0", b'cycles = "\\u001b[2J\\u0007"'),
    "name with a path": _S.replace(b'"s"', b'"../../etc/passwd"'),
    "name with an escape sequence": _S.replace(b'"s"', b'"s\\u001b[2J"'),
    "scene that is a device": _S.replace(b"scene.h5", b"/dev/zero"),
    "scene that is the study": _S.replace(b"scene.h5", b"./study"),
    "date": _S.replace(b"[150.0]", b"9999-99-99"),
    "points without end": _S.replace(
        b"[150.0]", b"{start = 1, stop = 2, num = 1000000}\nstep = {start = 1, stop = 2, num = 1000000}"
    ),
    "outputs without end": _S.replace(b"outputs = 1", b"outputs = 1000000000000"),
    "counts of no memory": _S.replace(b"cycles = 0\noutputs = 1", b"cycles = 1e9\noutputs = 10000000"),
    "long list": _S.replace(b"[150.0]", b"[" + b"1," * 1_000_000 + b"]"),
    "long list of words": _S.replace(b"[slow_time]", b"scheme = [" + b'"implicit",' * 100_000 + b"]\n[slow_time]"),
}
"""Texts of study files; the scene is that of the slider."""


def change_scene(path: Path, change: Change) -> None:
    with h5py.File(path, "r+") as file:
        change(file)


def sparse_file(path: Path) -> None:
    """A file that begins like HDF5 and claims a terabyte."""
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    with contextlib.suppress(OSError):
        os.truncate(path, 2**40)
