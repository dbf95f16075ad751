"""Array types, and read-only copies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


def frozen(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Return a read-only C-contiguous copy."""
    array = np.array(values, dtype=dtype, order="C")
    array.flags.writeable = False
    return array
