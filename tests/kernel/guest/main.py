"""Runs the suites in the guest and reports each test to the host as one line of JSON on ttyS1."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import pytest

HERE = Path(__file__).resolve().parent
CONTRACTS = HERE.parents[1] / "contract"
REPORT = Path("/dev/ttyS1")


class Reporter:
    """A pytest plugin: tells every test's end as it happens."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file

    def say(self, **words: object) -> None:
        """One line to the host."""
        self._file.write(json.dumps(words) + "\n")
        self._file.flush()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """What is to come: a test that is never heard of has failed."""
        self.say(planned=[item.nodeid for item in session.items])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Passed or skipped calls, and whatever failed."""
        if report.when == "call" or not report.passed:
            words = str(report.longrepr)[-1500:] if report.failed else ""
            self.say(
                test=report.nodeid,
                outcome=report.outcome,
                seconds=report.duration,
                words=words,
                figures=report.user_properties,
            )


def main() -> int:
    """Run everything; returns pytest's exit code."""
    sys.path.insert(0, str(HERE))
    with REPORT.open("w") as file:
        reporter = Reporter(file)
        started = time.monotonic()
        reporter.say(state="booted", uptime=float(Path("/proc/uptime").read_text().split()[0]))
        gadget = subprocess.Popen([sys.executable, str(HERE / "brick_gadget.py")])
        checks = sorted(str(path) for path in HERE.glob("check_*.py"))
        only = Path("/srv/orders/only").read_text()
        options = ["-k", only, "-p", "no:cacheprovider", "-v", "--color=no", "-o", "faulthandler_timeout=90"]
        code = pytest.main([*options, str(CONTRACTS), *checks], plugins=[reporter])
        gadget.terminate()
        reporter.say(state="over", code=int(code), seconds=time.monotonic() - started)
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
