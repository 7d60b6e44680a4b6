"""The common shape of every bench's result: rows of figures, bars they are held to, JSON or a table."""

from __future__ import annotations

import argparse
import json
import platform
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from rich.console import Console
from rich.table import Table

from robot import __version__


@dataclass(frozen=True, slots=True)
class Bar:
    """A figure and what it is held to; `at_most` says on which side it must lie."""

    name: str
    value: float
    bar: float
    at_most: bool = True

    @property
    def holds(self) -> bool:
        """True if the figure keeps its bar (NaN never does)."""
        return self.value <= self.bar if self.at_most else self.value >= self.bar


_LOG_WIDTH = 180


def arguments(words: str) -> argparse.ArgumentParser:
    """The options every bench has."""
    parser = argparse.ArgumentParser(description=words)
    parser.add_argument("--json", action="store_true", help="print JSON on standard output")
    parser.add_argument("--data", help="folder of real images, where a bench uses them")
    parser.add_argument("--full", action="store_true", help="the whole measurement, not the ten-minute one")
    return parser


def publish(name: str, rows: Sequence[dict[str, Any]], bars: Sequence[Bar], as_json: bool) -> int:
    """Print the result; returns the exit code: 0 if every bar holds, else 1."""
    if as_json:
        result = {
            "bench": name,
            "versions": versions(),
            "rows": list(rows),
            "bars": [
                {"name": bar.name, "value": bar.value, "bar": bar.bar, "holds": bar.holds} for bar in bars
            ],
        }
        json.dump(result, sys.stdout, indent=1)
        print()
    else:
        _print_tables(name, rows, bars)
    return 0 if all(bar.holds for bar in bars) else 1


def versions() -> dict[str, str]:
    """What was measured with."""
    packages = ("numpy", "opencv-python-headless", "mujoco")
    own = {"robot": __version__, "python": platform.python_version(), "machine": platform.machine()}
    return own | {package: version(package) for package in packages}


def _print_tables(name: str, rows: Sequence[dict[str, Any]], bars: Sequence[Bar]) -> None:
    console = Console()
    if not console.is_terminal:
        console = Console(width=_LOG_WIDTH)  # a pipe says no width; 80 columns would cut the words
    keys = list(dict.fromkeys(key for row in rows for key in row))
    table = Table(*keys, title=name)
    for row in rows:
        table.add_row(*(_shown(row.get(key, "")) for key in keys))
    console.print(table)
    verdicts = Table("figure", "value", "bar", "holds")
    for bar in bars:
        sign = "<=" if bar.at_most else ">="
        verdicts.add_row(bar.name, _shown(bar.value), f"{sign} {bar.bar:g}", "yes" if bar.holds else "NO")
    console.print(verdicts)


def _shown(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
