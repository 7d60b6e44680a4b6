"""The folder one run leaves behind: runs/<time>/ with events.jsonl, report.json, run.mp4, trajectory.png.

`runs/latest` always points to the newest. The report appears whole or not at all.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from datetime import datetime
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np

from robot.errors import UserError
from robot.record.events import EventLog
from robot.record.recording import Recording

LATEST = "latest"


class RunFolder:
    """One run's folder. Make it with `RunFolder.create`.

    >>> import tempfile
    >>> from datetime import datetime
    >>> root = Path(tempfile.mkdtemp())
    >>> folder = RunFolder.create(root, started=datetime(2024, 5, 17, 9, 30, 0))
    >>> folder.path.name, (root / "latest").resolve() == folder.path.resolve()
    ('2024-05-17_09-30-00', True)
    >>> folder.write_report({"success": True})
    True
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.recording = Recording()
        """Shared by all that writes here; hand it to the video writer too."""
        self._events_file: FileIO | None = None

    @classmethod
    def create(cls, root: Path, started: datetime) -> RunFolder:
        """Make `root`/<started>/ (with -2, -3 ... if taken) and let `root`/latest point to it.

        Raises UserError if the folder cannot be made.
        """
        name = started.strftime("%Y-%m-%d_%H-%M-%S")
        try:
            root.mkdir(parents=True, exist_ok=True)
            folder = cls(_make_unused(root, name))
        except OSError as error:
            raise UserError(
                f"cannot make a run folder in {root}: {error.strerror or error}; choose a writable folder"
            ) from error
        _point_latest_to(folder.path)
        return folder

    @property
    def events_path(self) -> Path:
        """Where the events go."""
        return self.path / "events.jsonl"

    @property
    def report_path(self) -> Path:
        """Where the report goes."""
        return self.path / "report.json"

    @property
    def video_path(self) -> Path:
        """Where the video goes."""
        return self.path / "run.mp4"

    @property
    def trajectory_path(self) -> Path:
        """Where the plot goes."""
        return self.path / "trajectory.png"

    def open_events(self) -> EventLog:
        """Start events.jsonl. If that fails the log is silent and `recording` says why."""
        with self.recording.guarded(0.0):
            # Unbuffered: what an event log holds when the power goes is what happened until then.
            self._events_file = FileIO(self.events_path, "w")
            return EventLog(self._events_file, self.recording)
        return EventLog(_Nowhere(), self.recording)

    def write_report(self, report: Mapping[str, Any]) -> bool:
        """Write report.json in one piece, with a note if recording stopped early.

        Raises ValueError naming the key if a value is NaN or infinite (nothing is written then). Returns
        False if the disk does not take it; an older report stays as it was.
        """
        plain = _plain({**report, **self.recording.summary()}, "report")
        text = json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        temporary = self.report_path.with_suffix(".json.tmp")
        try:
            with open(temporary, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, self.report_path)
        except OSError:
            _remove_quietly(temporary)
            return False
        return True

    def close(self) -> None:
        """Close what is open. May be called twice."""
        if self._events_file is not None:
            self._events_file.close()
            self._events_file = None


class _Nowhere:
    """The stream of a log that could not be opened."""

    def write(self, data: bytes, /) -> int:
        return len(data)

    def truncate(self, size: int | None = None, /) -> int:
        return 0


def _make_unused(root: Path, name: str) -> Path:
    attempt = 1
    while True:
        path = root / (name if attempt == 1 else f"{name}-{attempt}")
        try:
            path.mkdir()
            return path
        except FileExistsError:
            attempt += 1


def _point_latest_to(path: Path) -> None:
    """Replace the link in one step, so that it never dangles; a file system without links has none."""
    temporary = path.parent / f".{LATEST}-{path.name}"
    try:
        temporary.symlink_to(path.name)
        os.replace(temporary, path.parent / LATEST)
    except OSError:
        _remove_quietly(temporary)


def _remove_quietly(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


def _plain(value: Any, key: str) -> Any:
    """The value in JSON's own types; NaN refused by the name of its key."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v, str(k)) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), key)
    if isinstance(value, list | tuple):
        return [_plain(item, key) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"report field {key!r} is {value}: write None for what is unknown")
    return value
