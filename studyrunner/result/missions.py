"""A result of missions as figures read it: missions under the name of the cycles that they replace, blocks apart."""

from __future__ import annotations

import xarray as xr

_NAMES = {
    "mission": "cycle",
    "last_mission": "last_cycle",
    "missions_to_target": "cycles_to_target",
    "missions_to_target_error": "cycles_to_target_error",
}


def as_history(dataset: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset | None]:
    """The dataset with missions as cycles and without what belongs to single blocks, and these variables.

    Of a result without missions the dataset as it is, and None.
    """
    if "block" not in dataset.dims:
        return dataset, None
    renamed = dataset.rename({name: new for name, new in _NAMES.items() if name in dataset.variables})
    of_blocks = [name for name, variable in renamed.variables.items() if "block" in variable.dims]
    history = renamed.drop_vars(of_blocks)
    # renaming and dropping variables loses the file to be closed
    history.set_close(dataset.close)
    return history, renamed[of_blocks]
