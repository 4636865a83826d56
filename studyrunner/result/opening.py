"""Opens result files: the one way to read a result, as it is, or what the report knows of it."""

from __future__ import annotations

import warnings
from pathlib import Path

import xarray as xr

from studyrunner.result.schema_check import check_dataset, reading_errors
from studyrunner.study.study_of_result import check_result_file


def open_result(path: str | Path) -> xr.Dataset:
    """Open a result file after a check that it is a result of `run-study`: sizes, dimensions and types.

    The dataset is that of `xarray.open_dataset(path)`, read when it is needed, and has the accessor `fretwear`. It
    keeps the file open until it is closed: use it in a `with` statement, or call its `load` and `close`. A file that is
    replaced meanwhile, by another run, stays as it was for this dataset.

    Raises
    ------
    UserError
        Where there is no such file, it is no result of `run-study`, or it is damaged: one line.
    """
    return _open(path)[0]


def open_known(path: str | Path) -> xr.Dataset:
    """What the report knows of a result file, with its texts cleaned, see `check_dataset`. Raises UserError."""
    return _open(path)[1]


def _open(path: str | Path) -> tuple[xr.Dataset, xr.Dataset]:
    source, path = str(path), Path(path)
    check_result_file(path, source)
    with reading_errors(source, every=True), warnings.catch_warnings(action="ignore"):
        # the same file as before, whatever its name looks like
        opened = xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False)
        try:
            return opened, check_dataset(opened, source)
        except BaseException:
            opened.close()
            raise
