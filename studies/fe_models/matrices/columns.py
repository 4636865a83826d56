"""Columns of numbers out of large text files."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from studies.fe_models.matrices.matrices import LARGEST_FILE, wrong
from studies.fe_models.text.read_errors import check_file, shown


def read_columns(path: Path, separator: str, kinds: tuple[type, ...], comment: str | None = None) -> list[np.ndarray]:
    """Columns of a text file, one array each, of the given types.

    separator: between the numbers; " " for any blanks. kinds: int or float of each column. comment: character with
    which lines begin that hold no numbers.

    Raises SceneError about "matrices" where a line is no such row.
    """
    check_file(path, LARGEST_FILE, "matrices")
    names = [f"c{place}" for place in range(len(kinds))]
    try:
        with warnings.catch_warnings():
            # a row that is longer than the others, and a number that is none of the type
            warnings.simplefilter("error", pd.errors.ParserWarning)
            warnings.simplefilter("ignore", RuntimeWarning)
            frame = pd.read_csv(
                path,
                sep=r"\s+" if separator == " " else separator,
                header=None,
                names=names,
                index_col=False,
                dtype=dict(zip(names, ("int64" if kind is int else "float64" for kind in kinds), strict=True)),
                comment=comment,
                encoding="latin-1",
                quoting=3,
                na_values=[],
                keep_default_na=False,
                engine="c",
            )
    except (ValueError, OverflowError, pd.errors.ParserError, pd.errors.ParserWarning) as error:
        what = " ".join("whole number" if kind is int else "value" for kind in kinds)
        wrong(path.name, f"a line is no row of numbers ({shown(str(error))})", f"give lines of {what!r}")
    columns = [frame[name].to_numpy() for name in names]
    if not columns[0].size:
        wrong(path.name, "no entries in the file", "export it again")
    return columns
