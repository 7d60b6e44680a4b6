"""What ends sectors besides their own cells."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.messages import FreeSpace
from robot.vision.sectors import ended_for_most

SECTOR = np.radians(1.5)


@settings(deadline=None, max_examples=60)
@given(st.integers(2, 40), st.integers(1, 300), st.integers(0, 1000))
def test_each_sector_ends_where_the_median_of_its_directions_does(sectors, directions, seed):
    """Against a plain loop; some directions lie beside all sectors, some sectors have none."""
    rng = np.random.default_rng(seed)
    bearings = -0.4 + np.arange(sectors) * SECTOR
    near, free = rng.uniform(0.2, 0.4, sectors), rng.uniform(0.5, 3.0, sectors)
    look = FreeSpace(bearings, near, free, np.zeros((0, 2)))
    angle = rng.uniform(bearings[0] - 0.2, bearings[-1] + 0.2, directions)
    away = rng.uniform(0.3, 2.5, directions)
    found = ended_for_most(look, np.column_stack([away * np.cos(angle), away * np.sin(angle)]))
    for k, bearing in enumerate(bearings):
        own = away[np.abs(angle - bearing) < 0.5 * SECTOR]
        expected = free[k] if not len(own) else min(free[k], max(float(np.median(own)), near[k]))
        assert np.isclose(found.free[k], expected)
