"""What a camera's flip setting does to a pair is named; what is a pair, or shows nothing, is not accused."""

from functools import cache

import numpy as np
import pytest
from rendered_pairs import RIG, Block, Pair, Room, render

from calib.model import StereoRig
from robot.vision.pair_flipped import flipped


@cache
def pair(samples: int = 2) -> Pair:
    return render(Room((Block(1.0, 0.1, 0.3, 0.3, 0.3, yaw=0.5),)), samples=samples)


@pytest.mark.parametrize(
    ("turned", "how"),
    [
        (np.s_[:, ::-1], "is mirrored against"),
        (np.s_[::-1], "is upside down and mirrored against"),
        (np.s_[::-1, ::-1], "is upside down against"),
    ],
)
def test_a_turned_picture_is_named(turned: tuple[slice, ...], how: str) -> None:
    said = flipped(pair().left, np.ascontiguousarray(pair().right[turned]), RIG)
    assert said is not None
    assert how in said
    assert "flip setting" in said
    said = flipped(np.ascontiguousarray(pair().left[turned]), pair().right, RIG)
    assert said is not None
    assert how in said


def test_one_camera_given_twice_is_named() -> None:
    said = flipped(pair().left, pair().left.copy(), RIG)
    assert said is not None
    assert "one camera is given as both eyes" in said


def test_pairs_and_pictures_of_nothing_are_not_accused() -> None:
    seen = pair()
    assert flipped(seen.left, seen.right, RIG) is None
    assert flipped(seen.right, seen.left, RIG) is None, "exchanged eyes are pair_check's to name"
    for level in (0, 120, 255):
        plain = np.full((288, 352), level, np.uint8)
        assert flipped(plain, plain, RIG) is None
    elsewhere = render(Room(size=1.0, floor_seed=3), pan=1.0, samples=1).right
    assert flipped(seen.left, elsewhere, RIG) is None


def test_wrong_pictures_are_refused() -> None:
    with pytest.raises(ValueError, match="the rig 100x80"):
        flipped(pair().left, pair().right, StereoRig.parallel(100, 80, 90.0, 0.06))
