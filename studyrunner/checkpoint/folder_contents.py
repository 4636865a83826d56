"""Reads what earlier runs have left in a run's folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studyrunner.checkpoint.packed_files import PACKED, packed_kind, packed_path, unpacked_path
from studyrunner.checkpoint.part_files import load_keys, load_record_keys
from studyrunner.checkpoint.part_writer import PARTIAL, PROGRESS, RECORDS, STARTS, PartWriter
from studyrunner.checkpoint.segment_index import PartFile, SegmentIndex
from studyrunner.system import files

_PART = re.compile(r"(\d{8})(-[0-9a-f]{12})?(\.npy|\.starts|\.progress)(\.z)?")
_OF_ANOTHER_VERSION = re.compile(r"\d{8}\.starts\.npz|[0-9a-f]{32}\.progress\.npz")


@dataclass(frozen=True)
class FolderContents:
    """Contents of a run's folder.

    indexes: one for each sort of entry. others: files with records of studies with other variables or lengths.
    last_number: largest number of a file. damaged: names of files that do not hold what was written. left_over: files
    that no run can use.
    """

    indexes: dict[str, SegmentIndex]
    others: list[PartFile]
    last_number: int
    damaged: list[str]
    left_over: list[Path]


def read_folder(writer: PartWriter, kind: np.dtype[np.void], *, alone: bool) -> FolderContents:
    """Reads a folder and unpacks the files that this study can use.

    writer: writes into the folder. kind: data type of a record. alone: whether no other run uses the folder.

    A damaged file is skipped: its entries are computed again. Raises OSError where a file cannot be read for another
    reason, such as a fault of the disk.
    """
    known = sorted(writer.folder.iterdir())
    indexes = {STARTS: SegmentIndex(), RECORDS: SegmentIndex(), PROGRESS: SegmentIndex()}
    others: list[PartFile] = []
    damaged: list[Path] = []
    unpacked: list[Path] = []
    last = 0
    for number, (path, match) in enumerate((path, match) for path in known if (match := _PART.fullmatch(path.name))):
        last = max(last, number, int(match[1]))
        try:
            if match[4] and (match[3] != RECORDS or packed_kind(path) == kind):
                writer.unpack(match[3], number, path)
                unpacked.append(path)
                found = unpacked_path(path)
            elif packed_path(path) in known:
                # a run has ended between writing the one and removing the other: what is packed is whole
                continue
            else:
                found = path
            file, of_this_kind = _look_into(found, match[3], number, kind, alone)
        except FileNotFoundError:
            # of a run that is at work here, where there are no locks
            continue
        except files.NotPlainError:
            damaged.append(path)
        except (OSError, MemoryError):
            # a disk that fails for now is no reason to throw anything away
            raise
        except Exception:
            damaged.append(path)
            if alone:
                path.unlink(missing_ok=True)
        else:
            if of_this_kind:
                indexes[match[3]].put(file)
            else:
                others.append(file)
    if unpacked:
        # what was unpacked is on the disk before what it was packed in goes
        files.sync_folder(writer.folder)
    left_over = [*unpacked, *(path for path in known if _is_left_over(path))] if alone else []
    for index in indexes.values():
        left_over += [file.path for file in index.take_dead()]
    return FolderContents(indexes, others, last, [path.name for path in damaged], left_over)


def _look_into(path: Path, sort: str, number: int, kind: np.dtype[np.void], alone: bool) -> tuple[PartFile, bool]:
    """A file, and whether it holds what this study can use."""
    n_bytes = path.lstat().st_size
    if sort != RECORDS:
        return PartFile(number, path, load_keys(path), n_bytes, alone), True
    if path.name.endswith(PACKED):
        return PartFile(number, path, (), n_bytes, alone), False
    found, keys = load_record_keys(path)
    return PartFile(number, path, keys, n_bytes, alone), found == kind


def _is_left_over(path: Path) -> bool:
    """Whether nobody has a use for a file: it was not finished, or is that of another version of this program."""
    of_a_part = path.name.endswith(PARTIAL) and _PART.fullmatch(path.name.removesuffix(PARTIAL))
    return bool(of_a_part or _OF_ANOTHER_VERSION.fullmatch(path.name)) and not path.is_dir()
