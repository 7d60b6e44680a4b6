"""The fault table for people and for programs."""

from __future__ import annotations

import json
import textwrap

from robot.faults import TABLE, Action, Row

_WIDTH = 100
_DOES = {
    Action.CARRY_ON: "carries on",
    Action.STOP: "stands until it is over",
    Action.HALT: "stands until a person arms it again",
}


def as_json() -> str:
    """The table as JSON: key -> action, detection_s, clears, words, person_may_drive."""
    rows = {
        key: {
            "action": row.action.name.lower(),
            "detection_s": row.detection_s,
            "clears": row.clears,
            "words": row.words,
            "person_may_drive": row.person_may_drive,
        }
        for key, row in TABLE.items()
    }
    return json.dumps(rows, indent=2) + "\n"


def as_text() -> str:
    """The table as plain text, one paragraph a fault."""
    return "\n".join(_paragraph(key, row) for key, row in TABLE.items())


def _paragraph(key: str, row: Row) -> str:
    drive = "; a person may drive on" if row.person_may_drive and row.action is not Action.CARRY_ON else ""
    lines = [
        f"{key:<20}noticed within {row.detection_s:g} s",
        *_wrapped(f"the robot {_DOES[row.action]}{drive}"),
        *_wrapped(row.words),
        *_wrapped(f"over when: {row.clears}"),
    ]
    return "\n".join(lines) + "\n"


def _wrapped(words: str) -> list[str]:
    indent = " " * 20
    return textwrap.wrap(words, _WIDTH, initial_indent=indent, subsequent_indent=indent)
