"""The line a person at the stick reads: short, true, the worst first."""

from robot.messages import Fault, Sent, Twist
from robot.status_line import WIDTH, status_line

STANDING = Sent(Twist(), None, 0.0)


def test_it_tells_state_speeds_battery_and_who_drives():
    line = status_line("teleop", Sent(Twist(0.12, -0.3), None, 0.0), 8.1, ())
    assert line == "teleop     v +0.12 w -0.30   8.1 V  you drive"
    assert "drives itself" in status_line("track", STANDING, None, ())
    assert "? V" in status_line("track", STANDING, None, ())
    assert "r to acknowledge" in status_line("halted", STANDING, 8.0, ())


def test_it_tells_what_holds_the_robot_up():
    assert status_line("track", Sent(Twist(), None, 0.0, "post in 0.20 m"), 8.0, ()).endswith(
        "(post in 0.20 m)"
    )
    assert "(" not in status_line("track", Sent(Twist(), None, 0.0, "acceleration"), 8.0, ())


def test_the_worst_fault_comes_first():
    faults = (Fault("lamp", "dead", 0.0), Fault("base", "stranded", 1.0), Fault("camera", "black", 0.5))
    assert status_line("halted", STANDING, 8.0, faults).endswith("! base.stranded +2")


def test_it_never_wraps_a_plain_terminal():
    long = Sent(Twist(), None, 0.0, "something that has a very long name indeed, longer than any terminal is")
    assert len(status_line("halted", long, 8.0, ())) <= WIDTH
