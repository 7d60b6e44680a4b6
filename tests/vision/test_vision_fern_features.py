"""Binary features: leaves do not change with the light, tests keep to their reach, bad settings are named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot.vision.fern_features import CHANNELS, Ferns, channels

TWO = np.random.default_rng(3)
PICTURE = TWO.integers(20, 110, (40, 52), np.uint8)


def ferns(count=6, bits=8, reach=6, seed=0):
    return Ferns.random(count, bits, reach, np.random.default_rng(seed))


def by_hand(drawn, planes, fern, row, column):
    """The plain form: one comparison after the other, pixels outside taken from the rim."""
    height, width = planes.shape[1:]
    leaf = 0
    for test in range(drawn.channel.shape[1]):
        values = []
        for away in (drawn.first[fern, test], drawn.second[fern, test]):
            y = min(max(row + int(away[0]), 0), height - 1)
            x = min(max(column + int(away[1]), 0), width - 1)
            values.append(int(planes[drawn.channel[fern, test], y, x]))
        leaf = 2 * leaf + (values[0] > values[1])
    return leaf


@pytest.mark.parametrize("step", [1, 2, 5])
def test_leaves_are_those_of_the_plain_form(step):
    drawn, planes = ferns(), channels(PICTURE)
    found = drawn.leaves(planes, step)
    assert found.shape == (6, -(-40 // step), -(-52 // step))
    for fern, row, column in ((0, 0, 0), (3, 7, 2), (5, 3, 9), (2, 7, 10)):
        assert found[fern, row, column] == by_hand(drawn, planes, fern, row * step, column * step)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.integers(0, 30))
def test_grey_tests_know_only_the_order_of_brightness(power, offset):
    """Any rising curve of brightness, here a power, leaves all leaves of grey tests as they are."""
    drawn = ferns()
    grey_only = Ferns(np.zeros_like(drawn.channel), drawn.first, drawn.second, drawn.reach)
    planes = channels(PICTURE).astype(np.int64)
    rising = planes**power + offset
    ranks = np.unique(rising[0], return_inverse=True)[1].reshape(rising[0].shape).astype(np.uint8)
    changed = np.stack([ranks, ranks, ranks])
    assert (grey_only.leaves(channels(PICTURE), 3) == grey_only.leaves(changed, 3)).all()


def test_light_that_is_twice_as_strong_changes_few_leaves_bits():
    drawn = ferns(count=12)
    bits = drawn.leaves(channels(PICTURE), 2) ^ drawn.leaves(channels(2 * PICTURE), 2)
    share = np.unpackbits(bits.astype(np.uint8)).mean()
    assert share < 0.03  # rounding of what differs by less than one grey level


def test_tests_compare_two_different_pixels_within_reach():
    drawn = ferns(count=40, reach=3)
    assert np.abs(drawn.first).max() <= 3
    assert np.abs(drawn.second).max() <= 3
    assert not (drawn.first == drawn.second).all(axis=-1).any()
    assert sorted(set(drawn.channel.ravel().tolist())) == list(range(CHANNELS))
    assert drawn.leaf_count == 256


def test_the_same_seed_draws_the_same_tests():
    one, same, other = ferns(seed=4), ferns(seed=4), ferns(seed=5)
    assert (one.first == same.first).all()
    assert not (one.first == other.first).all()


@pytest.mark.parametrize("bad", [{"count": 0}, {"bits": 0}, {"bits": 13}, {"reach": 0}, {"reach": 33}])
def test_settings_out_of_range_are_named(bad):
    with pytest.raises(ValueError, match="bits 1 to 12"):
        ferns(**bad)


def test_colour_and_grey_pictures_have_the_same_channels():
    coloured = np.repeat(PICTURE[..., None], 3, axis=2)
    assert np.abs(channels(coloured).astype(int) - channels(PICTURE)).max() <= 1
