"""The form in which the solver hands out what is to be kept; see `packing`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Packed:
    """A value as JSON text that refers to arrays by their place."""

    text: str
    arrays: tuple[NDArray[np.generic], ...]
