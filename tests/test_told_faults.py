"""Drills: every row of the fault table can be ordered."""

import pytest

from robot.errors import UserError
from robot.faults import TABLE
from robot.told_faults import Drill, ToldFault


@pytest.mark.parametrize("key", TABLE)
def test_every_row_can_be_told_and_ends(key):
    device, kind = key.split(".")
    drill = Drill([ToldFault(device, kind, 1.0, 0.5)])
    told = [[fault.key for fault in drill.faults(0.04 * tick)] for tick in range(60)]
    assert told[24] == []
    assert told[25] == [key]
    assert told[37] == [key]
    assert told[38] == []


def test_what_is_no_row_is_refused_with_those_there_are():
    with pytest.raises(UserError, match=r"camera\.tired.*there are: .*camera\.black"):
        ToldFault("camera", "tired", 1.0)


@pytest.mark.parametrize(("at", "duration"), [(-1.0, None), (float("nan"), None), (1.0, 0.0)])
def test_times_that_are_none_are_refused(at, duration):
    with pytest.raises(UserError, match="time must be"):
        ToldFault("camera", "black", at, duration)
