"""runs/<time>/: unique folders, the latest link, a report that is whole or not there."""

from __future__ import annotations

import json
import math
import os
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from robot.errors import UserError
from robot.record.run_folder import RunFolder

NOON = datetime(2024, 5, 17, 12, 0, 0)


def test_folder_is_named_after_its_start_and_never_reused(tmp_path: Path) -> None:
    names = [RunFolder.create(tmp_path / "runs", NOON).path.name for _ in range(3)]
    assert names == ["2024-05-17_12-00-00", "2024-05-17_12-00-00-2", "2024-05-17_12-00-00-3"]


def test_latest_points_to_the_newest_and_moves_with_the_tree(tmp_path: Path) -> None:
    root = tmp_path / "runs"
    RunFolder.create(root, NOON)
    newest = RunFolder.create(root, NOON.replace(hour=13))
    assert (root / "latest").resolve() == newest.path.resolve()
    assert not os.path.isabs(os.readlink(root / "latest"))
    assert sorted(p.name for p in root.iterdir()) == ["2024-05-17_12-00-00", "2024-05-17_13-00-00", "latest"]


def test_a_root_that_cannot_be_made_is_a_user_error_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="choose a writable folder") as caught:
        RunFolder.create(tmp_path / "file" / "runs", NOON)
    assert "\n" not in str(caught.value)


def test_report_round_trips_numpy_and_nesting(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    report = {
        "success": True,
        "tick_ms": {"median": np.float64(1.5)},
        "n": np.int64(3),
        "xs": (1, np.array([2.0])),
    }
    assert folder.write_report(report)
    assert json.loads(folder.report_path.read_text()) == {
        "success": True,
        "tick_ms": {"median": 1.5},
        "n": 3,
        "xs": [1, [2.0]],
    }


@pytest.mark.parametrize("bad", [math.nan, math.inf, np.float64("nan")])
def test_nan_in_a_report_is_refused_by_name_and_the_old_report_stays(tmp_path: Path, bad: float) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    folder.write_report({"spl": 1.0})
    with pytest.raises(ValueError, match="'spl'"):
        folder.write_report({"deep": [{"spl": bad}]})
    assert json.loads(folder.report_path.read_text()) == {"spl": 1.0}


def test_a_report_that_does_not_fit_leaves_the_old_one_and_no_debris(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    assert folder.write_report({"version": 1})

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    assert not folder.write_report({"version": 2})
    assert json.loads(folder.report_path.read_text()) == {"version": 1}
    assert [p.name for p in folder.path.iterdir()] == ["report.json"]


def test_events_are_on_the_disk_as_soon_as_they_are_written(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    log = folder.open_events()
    log.write("status", 0.04, x=1.0)
    assert folder.events_path.read_bytes() == b'{"t":0.040,"kind":"status","x":1.0000}\n'
    folder.close()
    folder.close()


def test_the_report_says_where_recording_stopped(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    folder.recording.stop(12.3456, "the disk is full")
    log = folder.open_events()
    log.write("status", 13.0)
    folder.write_report({"success": True})
    assert folder.events_path.read_bytes() == b""
    assert json.loads(folder.report_path.read_text()) == {
        "success": True,
        "recording_stopped_at": 12.346,
        "recording_stopped_reason": "the disk is full",
    }


def test_events_that_cannot_be_opened_do_not_stop_the_run(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    folder.events_path.mkdir()
    folder.open_events().write("status", 1.0)
    assert folder.recording.stopped is not None


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs the kernel's /dev/full")
def test_a_truly_full_device_is_survived(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, NOON)
    folder.events_path.symlink_to("/dev/full")
    folder.open_events().write("status", 2.0)
    assert folder.recording.stopped is not None
    assert folder.recording.stopped.at == 2.0
    folder.close()
