"""`make test-kernel`: the drivers' contract suites before devices of a real kernel. See README.md.

Prints what passed as a table; exit code 0 if everything did, 1 if not, 2 if the tier cannot run here.
"""

from __future__ import annotations

import argparse
import fcntl
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from image import REPOSITORY, TierError, check_tools, prepare
from machine import reports

BUILD: Final = REPOSITORY / "build" / "kernel"
_TIMEOUT_S: Final = 900.0


@dataclass
class Outcome:
    """What the guest told: node ids in the order planned, outcomes and words by node id."""

    planned: list[str] = field(default_factory=list)
    outcomes: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)
    figures: list[str] = field(default_factory=list)
    over: bool = False

    def take(self, report: dict[str, Any]) -> None:
        """Add one report."""
        if "planned" in report:
            self.planned = list(report["planned"])
        elif "test" in report:
            self._ended(report)
        elif report.get("state") == "over":
            self.over = True

    @property
    def all_passed(self) -> bool:
        """True if the guest came to its end and every planned test passed."""
        return self.over and bool(self.planned) and all(self.outcome(t) == "passed" for t in self.planned)

    def outcome(self, test: str) -> str:
        """passed, failed, skipped, or lost: planned and never heard of."""
        return self.outcomes.get(test, "lost")

    def _ended(self, report: dict[str, Any]) -> None:
        test = str(report["test"])
        # A failure while tidying up comes after the call passed, and counts.
        if self.outcomes.get(test) != "failed":
            self.outcomes[test] = str(report["outcome"])
        if report["words"]:
            self.words[test] = str(report["words"])
        self.figures += [f"{name}: {value}" for name, value in report["figures"]]


def watch(stream: Iterable[dict[str, Any]], say: Callable[[str], None]) -> Outcome:
    """Read the guest's reports to their end, telling each test as it ends."""
    outcome = Outcome()
    started = time.monotonic()
    for report in stream:
        outcome.take(report)
        if "test" in report:
            say(f"{report['outcome']:8} {report['seconds']:6.1f} s  {_short(report['test'])}")
        elif "planned" in report:
            say(f"{len(outcome.planned)} tests")
        else:
            say(f"guest {report['state']} after {time.monotonic() - started:.0f} s")
    return outcome


def table(outcome: Outcome) -> str:
    """Passed and planned by suite, figures, then the words of whatever did not pass."""
    suites = sorted({_suite(test) for test in outcome.planned})
    width = max((len(suite) for suite in suites), default=0)
    lines = [f"{'suite':{width}}  passed  of"]
    for suite in suites:
        tests = [test for test in outcome.planned if _suite(test) == suite]
        passed = sum(outcome.outcome(test) == "passed" for test in tests)
        lines.append(f"{suite:{width}}  {passed:6}  {len(tests):2}")
    lines += ["", *outcome.figures] if outcome.figures else []
    for test in outcome.planned:
        if outcome.outcome(test) != "passed":
            lines += ["", f"{outcome.outcome(test).upper()} {_short(test)}", outcome.words.get(test, "")]
    if not outcome.over:
        lines += ["", "the guest ended before its tests did: see build/kernel/console.log"]
    elif not outcome.planned:
        lines += ["", "no test was found: see build/kernel/console.log"]
    return "\n".join(lines)


def _short(test: str) -> str:
    path, bracket, values = test.partition("[")
    return path.rpartition("/")[2] + bracket + values


def _suite(test: str) -> str:
    """Module and, of a contract, the rig: `test_contract_base kernel-usb`."""
    module, _, name = _short(test).partition(".py::")
    rig = name.partition("[")[2].rstrip("]")
    return f"{module} {'-'.join(rig.split('-')[:2])}" if rig.startswith("kernel-") else module


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="tests/kernel/run", description=__doc__)
    parser.add_argument("--timeout", type=float, default=_TIMEOUT_S, help="seconds the guest may be on")
    parser.add_argument("--only", default="kernel", metavar="EXPRESSION", help="pytest -k, e.g. check_camera")
    options = parser.parse_args()
    try:
        check_tools()
        BUILD.mkdir(parents=True, exist_ok=True)
        with _alone(BUILD / "lock"):
            image = prepare(BUILD, {"only": options.only})
            stream = reports(image, BUILD / "console.log", options.timeout)
            outcome = watch(stream, lambda line: print(line, flush=True))
    except TierError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"\n{table(outcome)}")
    return 0 if outcome.all_passed else 1


@contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Two runs would share one image."""
    with lock.open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise TierError("another run of the kernel tier is under way: wait for it") from error
        yield


if __name__ == "__main__":
    sys.exit(main())
