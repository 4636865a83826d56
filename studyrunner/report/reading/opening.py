"""Opens a result file."""

from __future__ import annotations

import warnings
from pathlib import Path

import xarray as xr

from studyrunner.report.reading.schema_check import reading_errors
from studyrunner.user_error import UserError


def open_file(path: Path | str) -> xr.Dataset:
    """The file as it is, read lazily. Raises UserError."""
    # the report itself knows nothing of studies and scenes
    from studyrunner.study.study_of_result import check_result_file

    path, source = Path(path), str(path)
    if not path.is_file():
        raise UserError(source, "OUT.nc", None, "there is no such file; give a result file of run-study")
    check_result_file(path, source)
    with reading_errors(source, every=True), warnings.catch_warnings(action="ignore"):
        # the same file as before, whatever its name looks like
        return xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False)
