"""The tier's own judgement: nothing that did not pass may look as if it had. The tier itself is `./run`."""

from __future__ import annotations

import io
import shutil
import subprocess
import tarfile
from pathlib import Path

import pytest
from cpio import CpioWriter
from image import TierError, check_tools
from tier import Outcome, table, watch

BOOTED = {"state": "booted", "uptime": 8.0}
OVER = {"state": "over", "code": 0, "seconds": 9.0}
BASE = "tests/contract/test_contract_base.py::test_stop[kernel-usb-0.2]"
CHECK = "tests/kernel/guest/check_usb.py::test_words[a/b::c]"


def ended(test: str, outcome: str = "passed", words: str = "") -> dict[str, object]:
    """A report of one test."""
    figures = [["exchange, ms", "0.4"]]
    return {"test": test, "outcome": outcome, "seconds": 0.1, "words": words, "figures": figures}


def told(*reports: dict[str, object]) -> Outcome:
    """What the tier makes of these reports."""
    return watch(reports, lambda line: None)


def test_everything_planned_passed() -> None:
    outcome = told(BOOTED, {"planned": [BASE, CHECK]}, ended(BASE), ended(CHECK), OVER)
    assert outcome.all_passed
    lines = [line.split() for line in table(outcome).splitlines()]
    assert ["test_contract_base", "kernel-usb", "1", "1"] in lines
    assert ["check_usb", "1", "1"] in lines
    assert ["exchange,", "ms:", "0.4"] in lines


@pytest.mark.parametrize(
    ("reports", "word"),
    [
        ([], "ended before"),
        ([BOOTED], "ended before"),
        ([BOOTED, {"planned": []}, OVER], "no test was found"),
        ([BOOTED, OVER], "no test was found"),
        ([{"planned": [BASE, CHECK]}, ended(BASE), OVER], "LOST check_usb.py::test_words[a/b::c]"),
        ([{"planned": [BASE]}, ended(BASE), {"state": "hung"}], "ended before"),
        ([{"planned": [BASE]}, ended(BASE, "failed", "too slow"), OVER], "too slow"),
        ([{"planned": [BASE]}, ended(BASE, "skipped"), OVER], "SKIPPED test_contract_base.py::test_stop"),
        ([{"planned": [BASE]}, ended(BASE), ended(BASE, "failed", "at the end"), OVER], "at the end"),
        ([{"planned": [BASE]}, ended(BASE, "failed", "at the start"), ended(BASE), OVER], "at the start"),
    ],
)
def test_whatever_did_not_pass_is_seen(reports, word) -> None:  # type: ignore[no-untyped-def]
    outcome = told(*reports)
    assert not outcome.all_passed
    assert word in table(outcome)


def test_missing_programs_are_named_with_the_cure(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.setattr(shutil, "which", lambda program: None)
    with pytest.raises(TierError, match="apt-get install qemu-system-x86 mmdebstrap"):
        check_tools()


@pytest.mark.skipif(shutil.which("cpio") is None, reason="cpio, the oracle, is not installed")
def test_archives_are_what_cpio_reads(tmp_path: Path) -> None:
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w") as archive:
        for member, data in _members():
            archive.addfile(member, io.BytesIO(data))
    packed.seek(0)
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "own.txt").write_text("mine")
    with (tmp_path / "all.cpio").open("wb") as file:
        cpio = CpioWriter(file)
        with tarfile.open(fileobj=packed) as archive:
            cpio.add_tar(archive, leave_out=("var/cache",))
    with (tmp_path / "own.cpio").open("wb") as file:
        cpio = CpioWriter(file)
        cpio.add_folder(tmp_path / "folder", "srv")
        cpio.finish()
    root = tmp_path / "root"
    root.mkdir()
    for name in ("all.cpio", "own.cpio"):
        with (tmp_path / name).open("rb") as file:
            subprocess.run(["cpio", "-id", "--quiet"], stdin=file, cwd=root, check=True)
    assert (root / "bin" / "tool").read_bytes() == b"odd"
    assert (root / "bin" / "tool").stat().st_mode & 0o777 == 0o755
    assert (root / "bin" / "twin").read_bytes() == b"odd"
    assert (root / "sbin").readlink() == Path("bin")
    assert list((root / "var" / "cache").iterdir()) == []
    assert (root / "srv" / "own.txt").read_text() == "mine"


def _members() -> list[tuple[tarfile.TarInfo, bytes]]:
    def member(name: str, kind: bytes, size: int = 0, mode: int = 0o755, target: str = "") -> tarfile.TarInfo:
        info = tarfile.TarInfo(name)
        info.type, info.size, info.mode, info.linkname = kind, size, mode, target
        return info

    return [
        (member("./bin", tarfile.DIRTYPE), b""),
        (member("./bin/tool", tarfile.REGTYPE, size=3), b"odd"),
        (member("./bin/twin", tarfile.LNKTYPE, target="./bin/tool"), b""),
        (member("./sbin", tarfile.SYMTYPE, target="bin"), b""),
        (member("./var/cache", tarfile.DIRTYPE), b""),
        (member("./var/cache/litter", tarfile.REGTYPE, size=2), b"xx"),
    ]
