"""What is learnt, as arrays by name: parts of a thing put their names behind a prefix."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


def below(prefix: str, arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Those arrays whose keys begin with a prefix, without it.

    >>> sorted(below("a.", {"a.x": np.zeros(1), "a.y": np.zeros(1), "b.x": np.zeros(1)}))
    ['x', 'y']
    """
    return {key.removeprefix(prefix): value for key, value in arrays.items() if key.startswith(prefix)}
