"""Studies in Python: read one, run it in this process, open a result. For use as `studyrunner.run_study` and so on."""

import contextlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import xarray as xr
from threadpoolctl import threadpool_limits

import studyrunner.accessor  # noqa: F401 - every Dataset gets `fretwear`
from studyrunner.checkpoint.store import Store
from studyrunner.mpi.ranks import Ranks, launcher_size
from studyrunner.result.opening import open_result
from studyrunner.result.provenance import check_date
from studyrunner.result.target import check_result
from studyrunner.run import compute_study
from studyrunner.study.study import Study
from studyrunner.study.study_file import read_study
from studyrunner.system.progress import ProgressDisplay
from studyrunner.user_error import StorageError, UserError

__all__ = ["StorageError", "Study", "UserError", "open_result", "read_study", "run_study"]


def run_study(
    study: Study | str | Path,
    output: str | Path | None = None,
    *,
    overrides: Sequence[str] | Mapping[str, object] = (),
    points: object = None,
    fresh: bool = False,
    overwrite: bool = False,
    retry_failed: bool = False,
    date: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run a study in this process, as the command `run-study` does, and open its result, which is the same to the last
    bit. A run that was ended early goes on, from here or by the command.

    - study: as `read_study` gives it, or what it reads: a path, or the name of a bundled study.
    - output: the result file; `<name of the study>.nc` in the current folder if not given.
    - overrides, points: as in `read_study`, where the study is not read yet. Of more points with the same output only
      those are computed that are new.
    - fresh: start over: forget what an earlier run of this study has left.
    - overwrite: replace a result that is of another study: one of another name or of another scene.
    - retry_failed: compute points that failed in an earlier run once more.
    - date: `date_created` of the result, in a form of ISO 8601, or `"now"`; none if not given: equal runs have equal
      files.
    - progress: whether stderr tells how far the run is.

    The dataset is as `open_result` gives it. Points that failed are no exception: `outcome` and `message` say why.

    Raises UserError where something is wrong, another run is at work, or a launcher has started several processes:
    nothing is computed then; StorageError where something cannot be written on the way: what was computed is kept;
    KeyboardInterrupt after Ctrl-C: the file holds the points that were computed until then.
    """
    if (announced := launcher_size()) > 1:
        remedy = "call it in one process, or give `mpiexec run-study`: here each process would compute all of it"
        raise UserError("run_study", "processes", announced, remedy)
    if not isinstance(study, Study):
        study = read_study(study, overrides, points)
    elif overrides or points is not None:
        key = "overrides" if overrides else "points"
        raise UserError("run_study", key, None, "give them to read_study: this study is read already")
    checked = None if date is None else check_date(date, "run_study", "date")
    path = Path(f"{study.study.name}.nc" if output is None else output)
    try:
        target = check_result("output", path, study, overwrite=overwrite, how="overwrite=True")
    except UserError as error:
        raise UserError("run_study", error.key, error.value, error.remedy) from None
    shown = ProgressDisplay(quiet=not progress)
    # the scene as well: with two threads its matrices differ in the last bits, and start states with them
    with threadpool_limits(1), contextlib.closing(Store(target.progress)) as store:
        compute_study(Ranks(), study, target, store, shown, fresh=fresh, retry_failed=retry_failed, date=checked)
        return open_result(target.path)
