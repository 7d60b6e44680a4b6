"""The fault matrix: every row of the fault table in every state, with the drivers plain and behind workers.

Times are simulated seconds, the longest over all cases of a row. `stop`: from the fault to the order that
stops the wheels, or to the silence where no order can arrive; `after_notice`: the same from when it was
noticed. `wheels`, `arm`: from the fault until they stand. Rows in brackets may take longer than half a
second; those with a star let a person at the stick drive on slowly. `--full`: every way a row comes about.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import Any

from bench.fault_cases import Outcome, cases
from bench.fault_matrix import SLOW_BY_NATURE, STOP_BAR_S, TICK_S, run
from bench.report import Bar, arguments, publish
from robot.faults import TABLE, Action


def table_rows(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """One row of figures for each row of the fault table, in its order."""
    return [_row(key, [outcome for outcome in outcomes if outcome.case.key == key]) for key in TABLE]


def _row(key: str, outcomes: Sequence[Outcome]) -> dict[str, Any]:
    entry = TABLE[key]
    slow = key in SLOW_BY_NATURE
    return {
        "fault": f"({key})" if slow else key,
        "action": entry.action.name.lower() + (" *" if entry.person_may_drive else ""),
        "noticed_s": _longest(outcome.detected_s for outcome in outcomes),
        "promised_s": entry.detection_s,
        "stop_s": _longest(outcome.stopped_s for outcome in outcomes),
        "after_notice_s": _longest(outcome.stopped_s - outcome.detected_s for outcome in outcomes),
        "wheels_s": _longest(outcome.wheels_stand_s for outcome in outcomes),
        "arm_s": _longest(outcome.arm_stands_s for outcome in outcomes),
        "cases": len(outcomes),
        "holds": "yes" if outcomes and not any(outcome.broken for outcome in outcomes) else "NO",
    }


def bars(outcomes: Sequence[Outcome]) -> list[Bar]:
    """What the whole matrix is held to."""
    stopping = [outcome for outcome in outcomes if outcome.case.action > Action.CARRY_ON]
    quick = [outcome for outcome in stopping if outcome.case.key not in SLOW_BY_NATURE]
    return [
        Bar("cases that do not hold", sum(bool(outcome.broken) for outcome in outcomes), 0.0),
        Bar("rows without a case", len(TABLE.keys() - {outcome.case.key for outcome in outcomes}), 0.0),
        Bar("cases", len(outcomes), 300.0, at_most=False),
        Bar(
            "longest stop after notice, s",
            _seconds(outcome.stopped_s - outcome.detected_s for outcome in stopping),
            TICK_S,
        ),
        Bar("longest stop after the fault, s", _seconds(outcome.stopped_s for outcome in quick), STOP_BAR_S),
    ]


def _longest(seconds: Iterable[float]) -> float | str:
    known = [value for value in seconds if value == value]
    return round(max(known), 3) + 0.0 if known else ""


def _seconds(seconds: Iterable[float]) -> float:
    longest = _longest(seconds)
    return longest if isinstance(longest, float) else float("nan")


def main() -> int:
    """Run the matrix and print it; what did not hold goes to standard error, case by case."""
    options = arguments(__doc__ or "").parse_args()
    outcomes = [run(case) for case in cases(every_way=options.full)]
    for outcome in outcomes:
        for words in outcome.broken:
            print(f"{outcome.case}: {words}", file=sys.stderr)
    return publish("faults", table_rows(outcomes), bars(outcomes), options.json)


if __name__ == "__main__":
    sys.exit(main())
