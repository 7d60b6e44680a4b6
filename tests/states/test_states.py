"""Each state by itself: what it wants to see, what it intends, and when it leaves."""

import math

import numpy as np
import pytest

from robot.messages import (
    Approach,
    Box,
    Detection,
    Follow,
    FreeSpace,
    HeadPose,
    Health,
    Hold,
    Odometry,
    Passage,
    Percepts,
    Pose2,
    Range,
    Situation,
    Timed,
    Track,
    Turn,
    Twist,
    Want,
)
from robot.nav.grid import ObstacleMap
from robot.states.avoid import Avoid
from robot.states.behaviour import Behaviour
from robot.states.halted import Halted
from robot.states.idle import Idle
from robot.states.range import Range as RangeState
from robot.states.recognize import Recognize
from robot.states.search import Search
from robot.states.teleop import Teleop
from robot.states.track import Track as TrackState

BEHAVIOUR = Behaviour()
BOX = Box(150, 80, 40, 60)
SEEN = Track(BOX, (0.0, 0.0), 0.9, lost=False)
LOST = Track(BOX, (0.0, 0.0), 0.1, lost=True)


def situation(now, *, pose=None, head=None, v=0.0, **percepts):
    pose = pose or Pose2()
    return Situation(
        now, Percepts(**percepts), Odometry(pose, Twist(v, 0.0), now), head or HeadPose(0.0, 0.35)
    )


def target_at(x, y, now, sigma=0.01):
    """Track, range and place of a target seen at (x, y) of the robot frame by a robot at the origin."""
    distance = math.hypot(x - 0.08, y)
    measured = Range(distance, sigma, (x, y, 0.1), 18.3 / distance)
    return {"track": Timed(SEEN, now), "target": Timed(measured, now), "place": Timed((x, y), now)}


def looks(now, *azimuths, score=0.9):
    return {"detections": Timed(tuple(Detection(BOX, score, "cup", azimuth) for azimuth in azimuths), now)}


def open_floor():
    """A map whose floor is seen free for 3 m all round."""
    floor = ObstacleMap()
    bearings = np.linspace(-math.pi, math.pi, 241)
    none = np.zeros((0, 2))
    look = FreeSpace(bearings, np.full(241, 0.05), np.full(241, 3.0), none)
    floor.update(look, Pose2(), 0.0)
    return floor


def with_wall(floor, x, half_width):
    """A wall across the way at x, seen often enough to be believed."""
    wall = np.column_stack([np.full(200, x), np.linspace(-half_width, half_width, 200)])
    none = np.zeros(0)
    for k in range(6):
        floor.update(FreeSpace(none, none, none, wall), Pose2(), 0.1 * k)
    return floor


class TestIdle:
    def test_arms_once_when_the_mission_says_so_and_the_eyes_are_good(self):
        idle = Idle(BEHAVIOUR, arm_at_start=True)
        idle.enter(situation(0.0))
        assert idle.step(situation(0.0))[1] is None, "no picture yet"
        bad = {"health": Timed(Health(0.0, "black"), 0.1)}
        assert idle.step(situation(0.1, **bad))[1] is None
        good = {"health": Timed(Health(90.0), 0.2)}
        assert idle.step(situation(0.2, **good))[1].name == "armed"
        assert idle.step(situation(0.3, **good))[1] is None, "never a second time unasked"

    def test_stays_disarmed_by_default(self):
        idle = Idle(BEHAVIOUR)
        assert idle.step(situation(0.0, health=Timed(Health(90.0), 0.0)))[1] is None


@pytest.mark.parametrize("state", [Halted(BEHAVIOUR), Teleop(BEHAVIOUR), Idle(BEHAVIOUR)])
def test_these_never_move_by_themselves(state):
    state.enter(situation(0.0))
    intent, event = state.step(situation(0.0, **target_at(2, 0, 0.0)))
    assert intent.motion == Hold()
    assert event is None


class TestSearch:
    def run(self, floor, until, **first):
        """Step a search whose every wish comes true at once; yields (time, intent, event)."""
        search = Search(BEHAVIOUR, floor)
        pose, head, now = Pose2(), HeadPose(), 0.0
        search.enter(situation(now, **first))
        while now < until:
            now += 0.04
            seen = {"detections": Timed((), now), "free_space": Timed(None, now)}
            intent, event = search.step(situation(now, pose=pose, head=head, **seen))
            head = intent.look
            if isinstance(intent.motion, Turn):
                pose = Pose2(pose.x, pose.y, intent.motion.heading)
            if isinstance(intent.motion, Follow):
                pose = Pose2(*intent.motion.path[-1], pose.yaw)
            yield now, intent, event
            if event is not None:
                return

    def test_asks_for_recognition_and_looks_all_round(self):
        seen = set()
        for _, intent, _ in self.run(open_floor(), 8.0):
            assert Want.RECOGNIZE in intent.wants
            heading = intent.motion.heading if isinstance(intent.motion, Turn) else 0.0
            seen.add((round(heading, 1), round(math.degrees(intent.look.pan))))
        pans = {pan for _, pan in seen}
        assert {0, 56, -56} <= pans
        assert len({heading for heading, _ in seen}) >= 3, "two turns of 120 degrees"

    def test_looks_first_where_the_target_was_last(self):
        place = {"place": Timed((1.0, 1.0), -1.0)}
        _, intent, _ = next(iter(self.run(open_floor(), 1.0, **place)))
        assert math.degrees(intent.look.pan) == pytest.approx(47, abs=3)

    def test_a_detection_ends_it(self):
        search = Search(BEHAVIOUR, open_floor())
        search.enter(situation(0.0))
        assert search.step(situation(0.1, **looks(0.05, 0.3)))[1].name == "candidate_seen"

    def test_a_look_from_before_it_began_does_not(self):
        search = Search(BEHAVIOUR, open_floor())
        search.enter(situation(1.0))
        assert search.step(situation(1.1, **looks(0.9, 0.3)))[1] is None

    def test_a_direction_just_rejected_is_not_tried_again_at_once(self):
        search = Search(BEHAVIOUR, open_floor())
        search.enter(situation(0.0))
        assert search.step(situation(0.1, **looks(0.1, 0.3)))[1] is not None
        search.enter(situation(1.0))
        assert search.step(situation(1.1, **looks(1.1, 0.31)))[1] is None
        assert search.step(situation(1.2, **looks(1.2, -0.8)))[1] is not None, "another direction is"
        assert search.step(situation(9.0, **looks(9.0, 0.3)))[1] is not None, "and later this one too"

    def test_gives_up_in_words_after_its_time(self):
        search = Search(BEHAVIOUR, open_floor())
        search.enter(situation(0.0))
        event = search.step(situation(BEHAVIOUR.search_timeout + 0.1))[1]
        assert event.name == "given_up"
        assert "not found" in event.reason

    def test_the_time_does_not_begin_anew_with_every_rejected_candidate(self):
        search = Search(BEHAVIOUR, open_floor())
        search.enter(situation(0.0))
        search.enter(situation(BEHAVIOUR.search_timeout - 1.0))
        assert search.step(situation(BEHAVIOUR.search_timeout + 0.1))[1].name == "given_up"


class TestRecognize:
    def test_sure_after_agreeing_looks(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0, **looks(-0.1, 0.5)))
        events = [
            state.step(situation(t, **looks(t, 0.5 + 0.01 * k)))[1] for k, t in enumerate((0.3, 0.5, 0.7))
        ]
        assert [event and event.name for event in events] == [None, None, "target_confirmed"]

    def test_looks_that_disagree_do_not_add_up(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0))
        for k in range(6):
            now = 0.3 + 0.2 * k
            assert state.step(situation(now, **looks(now, 0.5 * (-1) ** k)))[1] is None

    def test_looks_that_never_agree_end_it(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0))
        for k in range(4 * BEHAVIOUR.confirm_frames):
            now = 0.3 + 0.2 * k
            event = state.step(situation(now, **looks(now, 0.5 * (-1) ** k)))[1]
        assert (event.name, event.evidence["agreeing"]) == ("candidate_rejected", 1)

    def test_a_busy_computer_that_looks_every_other_second_is_sure_all_the_same(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0))
        events = [
            state.step(situation(now / 10, **looks(now // 20 * 2.0, 0.5)))[1]
            for now in range(1, 20 * BEHAVIOUR.confirm_frames + 1)
        ]
        assert [event.name for event in events if event] == ["target_confirmed"]

    def test_rejected_when_looks_miss_or_none_comes(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0))
        events = [state.step(situation(t, **looks(t)))[1] for t in (0.3, 0.5, 0.7)]
        assert events[-1].name == "candidate_rejected"
        state.enter(situation(10.0))
        assert state.step(situation(13.0))[1].name == "candidate_rejected"

    def test_one_look_counts_once(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0))
        assert all(state.step(situation(0.3 + 0.04 * k, **looks(0.3, 0.5)))[1] is None for k in range(20))

    def test_turns_the_head_to_where_the_candidate_was_seen(self):
        state = Recognize(BEHAVIOUR)
        state.enter(situation(0.0, **looks(-0.1, 0.7)))
        intent, _ = state.step(situation(0.04, pose=Pose2(0, 0, 0.2)))
        assert intent.look.pan == pytest.approx(0.5)
        assert intent.motion == Hold()


class TestRange:
    def test_leaves_with_the_median_of_agreeing_ranges(self):
        state = RangeState(BEHAVIOUR)
        state.enter(situation(0.0))
        for k in range(5):
            now = 0.04 * (k + 1)
            intent, event = state.step(situation(now, **target_at(1.5 + 0.01 * k, 0.4, now)))
        assert event.name == "target_ranged"
        assert event.evidence["distance_m"] == pytest.approx(1.494, abs=0.01)
        assert intent.look.pan == pytest.approx(math.atan2(0.4, 1.54 - 0.06), abs=0.01), "between the axes"

    def test_doubtful_ranges_do_not_count(self):
        state = RangeState(BEHAVIOUR)
        state.enter(situation(0.0))
        for k in range(20):
            now = 0.04 * (k + 1)
            assert state.step(situation(now, **target_at(1.5, 0.0, now, sigma=0.4)))[1] is None
        assert state.step(situation(4.0))[1].name == "target_lost"


class TestTrack:
    def state(self, floor=None):
        state = TrackState(BEHAVIOUR, floor or open_floor())
        state.enter(situation(0.0))
        return state

    def test_approaches_with_eyes_on_the_target(self):
        intent, event = self.state().step(situation(0.1, **target_at(2.0, 0.5, 0.1)))
        assert isinstance(intent.motion, Approach)
        assert intent.motion.bearing == pytest.approx(math.atan2(0.5, 2.0))
        assert intent.motion.stand_off == BEHAVIOUR.stand_off
        assert intent.look.pan == pytest.approx(math.atan2(0.5, 1.94))
        assert event is None

    def test_what_the_base_turned_since_the_picture_is_taken_off(self):
        seen = target_at(2.0, 0.0, 0.1)
        intent, _ = self.state().step(situation(0.2, pose=Pose2(0, 0, 0.3), **seen))
        assert intent.motion.bearing == pytest.approx(-0.3)

    def test_stands_still_while_lost_and_leaves_when_it_lasts(self):
        state = self.state()
        state.step(situation(0.1, **target_at(2.0, 0.0, 0.1)))
        lost = {"track": Timed(LOST, 0.2), "place": Timed((2.0, 0.0), 0.1)}
        intent, event = state.step(situation(0.3, **lost))
        assert intent.motion == Hold()
        assert Want.RECOGNIZE not in intent.wants, "its place is looked at first: that is cheap"
        assert event is None
        assert Want.RECOGNIZE in state.step(situation(1.5, **lost))[0].wants
        assert state.step(situation(3.0, **lost))[1].name == "target_lost"

    def test_something_more_like_the_target_is_looked_at(self):
        seen = target_at(2.0, 0.0, 0.1)
        rival = Detection(Box(10, 10, 30, 40), 0.9, "box", 0.4)
        state = self.state()
        intent, event = state.step(situation(0.2, better=Timed(rival, -0.5), **seen))
        assert event is None, "told before this state began"
        assert Want.REVIEW in intent.wants
        _, event = state.step(situation(0.2, better=Timed(rival, 0.15), **seen))
        assert (event.name, event.evidence["azimuth"]) == ("candidate_seen", 0.4)

    def test_an_old_range_is_as_good_as_none(self):
        intent, _ = self.state().step(situation(1.0, **target_at(2.0, 0.0, 0.1)))
        assert intent.motion == Hold()

    def test_something_in_the_straight_way_leads_to_a_detour(self):
        state = self.state(with_wall(open_floor(), 1.0, 0.4))
        events = []
        for k in range(10):
            now = 0.1 + 0.04 * k
            events.append(state.step(situation(now, **target_at(2.5, 0.0, now)))[1])
        assert events[0] is None, "a moment's doubt is not enough"
        assert any(event is not None and event.name == "way_blocked" for event in events)

    def test_the_target_itself_does_not_block_the_way(self):
        state = self.state(with_wall(open_floor(), 1.5, 0.1))
        for k in range(20):
            now = 0.1 + 0.04 * k
            assert state.step(situation(now, v=0.2, **target_at(1.5, 0.0, now)))[1] is None

    def test_no_progress_is_noticed(self):
        state = self.state()
        for k in range(100):
            now = 0.1 + 0.04 * k
            event = state.step(situation(now, v=0.0, **target_at(2.0, 0.0, now)))[1]
            if event is not None:
                break
        assert event.name == "way_blocked"
        assert 2.0 < now < 3.5


def walled_in():
    """A map of a robot with walls half a metre away all round."""
    floor = with_wall(open_floor(), 0.5, 3.0)
    with_wall(floor, -0.5, 3.0)
    side = np.column_stack([np.linspace(-0.6, 0.6, 80), np.full(80, 0.5)])
    none = np.zeros(0)
    for k in range(6):
        for sign in (1, -1):
            floor.update(FreeSpace(none, none, none, side * (1, sign)), Pose2(), 0.1 * k)
    return floor


def seen_passage(diameter, safe):
    """A look at the floor that shows one passage, ahead to the left."""
    none = np.zeros(0)
    passage = Passage((120.0, 90.0), 30.0, diameter, (1.0, 0.4, 0.16), safe=safe)
    return FreeSpace(none, none, none, np.zeros((0, 2)), passage)


class TestAvoid:
    def test_plans_round_a_wall_and_never_through_it(self):
        state = Avoid(BEHAVIOUR, with_wall(open_floor(), 1.0, 0.4))
        state.enter(situation(0.0))
        intent, event = state.step(situation(0.1, **target_at(2.2, 0.0, 0.1)))
        assert event is None
        assert isinstance(intent.motion, Follow)
        path = intent.motion.path
        assert max(abs(y) for _, y in path) > 0.5
        assert Want.TRACK in intent.wants

    def test_looks_for_the_target_again_when_the_track_is_lost(self):
        state = Avoid(BEHAVIOUR, with_wall(open_floor(), 1.0, 0.4))
        state.enter(situation(0.0))
        lost = {"track": Timed(LOST, 0.1), "place": Timed((2.2, 0.0), 0.0)}
        intent, _ = state.step(situation(0.1, **lost))
        assert Want.RECOGNIZE in intent.wants

    def test_leaves_to_track_when_the_straight_way_is_free_and_the_target_in_view(self):
        state = Avoid(BEHAVIOUR, open_floor())
        state.enter(situation(0.0))
        event = state.step(situation(1.2, **target_at(2.0, 0.0, 1.2)))[1]
        assert event.name == "way_free"

    def test_a_free_way_without_the_target_in_view_is_driven_on_then_searched(self):
        state = Avoid(BEHAVIOUR, open_floor())
        state.enter(situation(0.0))
        lost = {"track": Timed(LOST, 1.2), "place": Timed((2.0, 0.0), 0.0)}
        assert state.step(situation(1.2, **lost))[1] is None
        arrived = Pose2(1.15, 0.0, 0.0)
        assert state.step(situation(2.2, pose=arrived, **lost))[1].name == "target_lost"

    def test_without_a_place_there_is_nothing_to_go_to(self):
        state = Avoid(BEHAVIOUR, open_floor())
        state.enter(situation(0.0))
        assert state.step(situation(0.1))[1].name == "target_lost"

    def test_without_a_way_it_stands_looks_round_and_gives_up(self):
        state = Avoid(BEHAVIOUR, walled_in())
        state.enter(situation(0.0))
        lost = {"track": Timed(LOST, 0.0), "place": Timed((2.0, 0.0), 0.0)}
        pans = set()
        for k in range(200):
            intent, event = state.step(situation(0.04 * (k + 1), **lost))
            assert intent.motion == Hold()
            pans.add(round(intent.look.pan, 1))
            if event is not None:
                break
        assert event.name == "target_lost"
        assert "no way" in event.reason
        assert len(pans) > 5

    @staticmethod
    def look_at(passage, now):
        """Where AVOID looks at the second `now` when it has no way and sees this passage from 0.1 s on."""
        state = Avoid(BEHAVIOUR, walled_in())
        state.enter(situation(0.0))
        place = Timed((2.0, 0.0), 0.0)
        state.step(situation(0.1, place=place, free_space=Timed(passage, 0.1)))
        intent, _ = state.step(situation(now, place=place, free_space=Timed(passage, now)))
        assert intent.motion == Hold()
        return intent.look

    @pytest.mark.parametrize("safe", [True, False])
    def test_without_a_way_it_turns_to_a_passage_wide_enough(self, safe):
        look = self.look_at(seen_passage(0.5, safe), 0.14)
        assert look.pan == pytest.approx(math.atan2(0.4, 1.0 - BEHAVIOUR.head_forward))

    def test_it_looks_up_at_a_passage_that_is_not_safe(self):
        assert self.look_at(seen_passage(0.5, True), 0.14).tilt == BEHAVIOUR.rest_tilt
        assert 0.0 < self.look_at(seen_passage(0.5, False), 0.14).tilt < 0.7 * BEHAVIOUR.rest_tilt

    def test_a_passage_too_narrow_is_not_looked_at(self):
        narrow = self.look_at(seen_passage(1.9 * BEHAVIOUR.body_radius, False), 0.14)
        assert abs(narrow.pan) < 0.1
        assert narrow.tilt == BEHAVIOUR.rest_tilt

    def test_it_does_not_stare_at_a_passage_for_ever(self):
        assert self.look_at(seen_passage(0.5, False), 2.6).tilt == BEHAVIOUR.rest_tilt

    def test_no_progress_on_the_detour_ends_it(self):
        state = Avoid(BEHAVIOUR, with_wall(open_floor(), 1.0, 0.4))
        state.enter(situation(0.0))
        lost = {"track": Timed(LOST, 0.0), "place": Timed((2.2, 0.0), 0.0)}
        for k in range(200):
            now = 0.04 * (k + 1)
            event = state.step(situation(now, **lost))[1]
            if event is not None:
                break
        assert "no way was made" in event.reason
        assert 6.0 < now < 7.0
