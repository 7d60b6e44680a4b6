"""The calibration is called wrong only by looks that agree while nothing turns, right again by as many."""

import math
from collections.abc import Iterable
from functools import cache

import pytest
from rendered_pairs import RIG, Block, Pair, Room, render

from robot.vision.misrectified import EVERY_S, LOOKS, Rectification, faults, updated
from robot.vision.pair_check import PairCheck, SignVotes, check_pair

DEGREE = math.radians(1.0)
IN_ORDER, EXCHANGED = SignVotes(40, 0), SignVotes(0, 40)


def look(
    down_px: float = 0.0, roll_px: float = 0.0, yaw: float = 0.0, matches: int = 60,
    votes: SignVotes = IN_ORDER, sigma_px: float = 0.06,
) -> PairCheck:  # fmt: skip
    parts = (down_px, roll_px, 0.0, 40.0 * yaw)
    return PairCheck(
        matches, 0.97, votes, pitch=down_px / 305, yaw=yaw, offset_px=down_px, parts_px=parts,
        error_px=math.hypot(*parts), error_sigma_px=sigma_px, yaw_sigma=0.1 * DEGREE, sigma_px=0.2,
    )  # fmt: skip


def after(looks: Iterable[PairCheck], every: float = EVERY_S, start: float = 0.0,
          state: Rectification | None = None, turning: float = 0.0) -> Rectification:  # fmt: skip
    state = state or Rectification()
    for number, seen in enumerate(looks):
        state = updated(state, seen, start + number * every, turning)
    return state


BAD, GOOD, UNSURE = look(1.8), look(0.1), look(0.65)


def test_looks_that_agree_for_long_enough_are_the_fault() -> None:
    assert not after([BAD] * (LOOKS - 1)).told
    state = after([BAD] * LOOKS)
    assert state.told
    (fault,) = faults(state)
    assert (fault.key, fault.since) == ("camera.misrectified", (LOOKS - 1) * EVERY_S)
    assert "the right picture lies 1.8 px too low" in fault.evidence
    assert "Calibrate again" in fault.evidence
    assert faults(Rectification()) == ()


@pytest.mark.parametrize(("rate_hz", "seconds"), [(12.5, 2.8), (5.0, 3.2), (2.0, 2.5), (1.0, 5.0)])
def test_how_long_it_takes(rate_hz: float, seconds: float) -> None:
    state, at = Rectification(), 0.0
    while not state.told and at < 20.0:
        state = updated(state, BAD, at)
        at += 1 / rate_hz
    assert state.since == pytest.approx(seconds, abs=0.45)
    assert state.since >= (LOOKS - 1) * EVERY_S - 1e-9


@pytest.mark.parametrize(
    "bad",
    [look(-1.2), look(roll_px=1.1), look(yaw=1.5 * DEGREE), look(0.85)],
    ids=["high", "roll", "yaw", "little"],
)
def test_every_kind_of_error_counts(bad: PairCheck) -> None:
    assert after([bad] * LOOKS).told


@pytest.mark.parametrize(
    "seen", [look(0.65), look(0.72), look(1.0, sigma_px=0.3), look(yaw=0.8 * DEGREE)],
    ids=["below", "hardly beyond", "beyond, but vague", "hardly turned"],
)  # fmt: skip
def test_what_is_not_sure_is_no_fault(seen: PairCheck) -> None:
    assert not after([seen] * 40).told


def test_looks_that_tell_nothing_change_nothing() -> None:
    blind = [look(5.0, matches=10), PairCheck(0, 0.0, SignVotes(0, 0)), look(5.0, votes=EXCHANGED)]
    assert after(blind * 10) == Rectification()
    state = after([BAD] * LOOKS)
    assert after(blind * 20, start=10.0, state=state) == state, "the dark mends no camera"


def test_one_odd_look_is_overlooked_and_two_are_doubt() -> None:
    odd = look(-4.0)
    assert after([BAD, BAD, odd, BAD, BAD, BAD]).told
    assert not after([BAD, odd, BAD, BAD, odd, BAD]).told
    assert not after([GOOD, GOOD, odd, GOOD, GOOD, GOOD]).told


def test_looks_of_long_ago_do_not_count() -> None:
    state = after([BAD] * (LOOKS - 1))
    assert not updated(state, BAD, at=60.0).told
    assert after([BAD] * LOOKS, start=60.0, state=state).told


def test_it_is_over_when_as_many_looks_say_so() -> None:
    told = after([BAD] * LOOKS)
    assert after([GOOD] * (LOOKS - 2), start=5.0, state=told).told
    over = after([GOOD] * LOOKS, start=5.0, state=told)
    assert not over.told
    assert faults(over) == ()
    assert after([BAD] * LOOKS, start=20.0, state=over).told


def test_between_good_and_bad_it_stays_as_it_was() -> None:
    assert not after([UNSURE] * 20).told
    told = after([BAD] * LOOKS)
    later = after([UNSURE] * 20, start=5.0, state=told)
    assert (later.since, later.evidence) == (told.since, told.evidence)


def test_eyes_turned_to_one_another_are_not_mended_by_rows_alone() -> None:
    told = after([look(yaw=1.5 * DEGREE)] * LOOKS)
    assert after([look(yaw=0.65 * DEGREE)] * LOOKS, start=5.0, state=told).told
    assert not after([look(yaw=0.1 * DEGREE)] * LOOKS, start=5.0, state=told).told


def test_a_look_taken_in_already_changes_nothing() -> None:
    state = updated(Rectification(), BAD, 1.0)
    assert updated(state, BAD, 1.0) is state


# -------------------------------------------------------------------------- eyes at different moments

SPACE = Room((Block(1.2, 0.1, 0.3, 0.3, 0.4, yaw=0.5),))
SKEW_S = 0.02
"""Half a picture's time at 25 a second: as far apart as two unsynchronised webcams' newest pictures are."""


@cache
def left_eye() -> Pair:
    return render(SPACE, samples=1)


def unsynchronised(pan_rate: float, tilt_rate: float) -> PairCheck:
    """A look of eyes SKEW_S apart while the head turns (radians a second)."""
    left = left_eye()
    right = render(SPACE, pan=pan_rate * SKEW_S, tilt=0.349 + tilt_rate * SKEW_S, samples=1, seed=1)
    return check_pair(left.left, right.right, RIG)


@pytest.fixture(scope="module")
def nods() -> list[PairCheck]:
    return [unsynchronised(0.0, rate) for rate in (1.0, 0.3, -0.3, -1.0)]


@pytest.fixture(scope="module")
def turns() -> list[PairCheck]:
    return [unsynchronised(rate, 0.0) for rate in (1.2, -1.2)]


def test_one_look_of_unsynchronised_eyes_is_off(nods: list[PairCheck], turns: list[PairCheck]) -> None:
    assert nods[0].offset_px == pytest.approx(-SKEW_S * 305, abs=0.5)  # the right eye is lower already
    assert nods[0].misrectified
    assert abs(turns[0].yaw) > 0.8 * DEGREE


def test_a_nodding_head_does_not_fool_it(nods: list[PairCheck]) -> None:
    assert not after(nods * 10).told


def test_a_head_that_sweeps_to_and_fro_does_not_fool_it(turns: list[PairCheck]) -> None:
    sweep = [turns[0]] * 4 + [turns[1]] * 4  # two seconds each way
    assert not after(sweep * 5).told


def test_turning_on_the_spot_does_not_fool_it_where_the_turning_is_known(turns: list[PairCheck]) -> None:
    assert not after([turns[0]] * 40, turning=1.2).told
    assert after([BAD] * LOOKS, turning=0.05).told
