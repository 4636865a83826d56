"""Numbers as text, on their way to the script on the page."""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import ArrayLike


def encode_floats(values: ArrayLike) -> str:
    """Numbers as base64 of little-endian 32 bit floats, the last index fastest; NaN stays NaN.

    Whole numbers are exact up to 2^24.
    """
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")
