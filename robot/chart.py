"""The chart: which state follows which, and on what event. Nothing else.

The chart knows no state's code; the loop asks it where the robot is and sends it events. Every event
carries a reason and evidence, which the loop logs.
"""

from __future__ import annotations

from statemachine import State, StateChart

AUTONOMOUS = ("search", "recognize", "range", "track", "avoid")
LEAVES = ("idle", *AUTONOMOUS, "teleop", "halted")


class RobotChart(StateChart[None]):
    """idle; autonomous {search, recognize, range, track, avoid}; teleop; halted.

    After teleop or a fault autonomy is entered by recognize or search, never by a stale track.
    """

    # The library's defaults swallow a callback's error and an unknown event; here both must be seen.
    catch_errors_as_events = False
    allow_event_without_transition = False

    idle = State(initial=True)

    class autonomous(State.Compound):  # noqa: N801 (the library takes the state's name from the class)
        search = State(initial=True)
        recognize = State()
        range = State()
        track = State()
        avoid = State()

        candidate_seen = search.to(recognize) | track.to(recognize)
        candidate_rejected = recognize.to(search)
        target_confirmed = recognize.to(range)
        target_ranged = range.to(track)
        target_lost = range.to(search) | track.to(search) | avoid.to(search)
        way_blocked = track.to(avoid)
        way_free = avoid.to(track)
        interrupted = (
            search.to(search)
            | recognize.to(search)
            | range.to(recognize)
            | track.to(recognize)
            | avoid.to(search)
        )

    teleop = State()
    halted = State()

    armed = idle.to(autonomous)
    given_up = autonomous.to(idle)
    disarmed = autonomous.to(idle) | halted.to(idle)
    teleop_taken = idle.to(teleop) | autonomous.to(teleop) | halted.to(teleop)
    teleop_released = teleop.to(idle)
    teleop_resumed = teleop.to(autonomous.recognize)
    fault_halted = idle.to(halted) | autonomous.to(halted) | teleop.to(halted)

    @property
    def leaf(self) -> str:
        """The innermost active state's name."""
        return next(name for name in LEAVES if name in self.configuration_values)


def mermaid() -> str:
    """The chart as a mermaid state diagram."""
    lines = format(RobotChart(), "mermaid").splitlines()
    return (
        "\n".join(line for line in lines if ":::active" not in line and "classDef" not in line).strip() + "\n"
    )
