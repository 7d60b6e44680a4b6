"""The fuzz bench: a small part of it on every parser, and that it notices what it is there to notice."""

from __future__ import annotations

import json
import random
import time

import pytest

from bench import fuzz, fuzz_harness
from bench.fuzz import SUBJECTS
from bench.fuzz_harness import Finding, InvalidMotionError, Subject, Tally, run_chunk, try_one, watchdog
from bench.fuzz_mutation import Source
from robot.hal.interfaces import DeviceError

INPUTS = 300
FULL = 32767


@pytest.fixture(scope="module", params=list(SUBJECTS))
def subject(request: pytest.FixtureRequest) -> Subject:
    """Each of the bench's parsers."""
    return SUBJECTS[request.param]()


# ----------------------------------------------------------------------------------------- every parser


def test_no_parser_crashes_hangs_moves_or_is_greedy(subject: Subject) -> None:
    tally = run_chunk(subject, seed=7, index=0, count=INPUTS)
    assert [str(finding) for finding in tally.findings] == []
    assert tally.counts == dict.fromkeys(("crash", "hang", "motion", "memory"), 0)
    assert tally.inputs == INPUTS


def test_valid_inputs_get_through_and_others_do_not(subject: Subject) -> None:
    """A bench whose inputs are all refused at the door, or all taken, tests little."""
    tally = run_chunk(subject, seed=8, index=0, count=INPUTS)
    assert 0.02 < tally.accepted / tally.inputs < 0.95


def test_inputs_follow_from_the_seed(subject: Subject) -> None:
    def drawn(seed: int) -> list[bytes]:
        rng = random.Random(f"{seed}/{subject.name}/0")
        return [subject.draw(rng) for _ in range(30)]

    assert drawn(1) == drawn(1)
    assert drawn(1) != drawn(2)


def test_each_row_has_its_parsers_name(subject: Subject) -> None:
    assert SUBJECTS[subject.name]().name == subject.name


# --------------------------------------------------------------------------------------------- mutation


def test_inputs_are_valid_random_and_spoiled_ones() -> None:
    source = Source([b"abcdefgh" * 4], longest=100)
    rng = random.Random(1)
    drawn = [source.draw(rng) for _ in range(2000)]
    valid = sum(data == b"abcdefgh" * 4 for data in drawn)
    shorter, longer = (sum(len(data) < 32 for data in drawn), sum(len(data) > 32 for data in drawn))
    assert 60 < valid < 400
    assert min(shorter, longer) > 200
    assert max(map(len, drawn)) <= 100
    assert len(set(drawn)) > 1500


def test_text_gets_odd_numbers_and_words() -> None:
    source = Source([b"width = 352\nname = 'left'\n", b"height = 1.5\n"], text=True)
    rng = random.Random(1)
    drawn = b"\n".join(source.draw(rng) for _ in range(2000))
    for piece in (b"width = nan", b"height = inf", b"9223372036854775808", b"[[[[", b"height = 352"):
        assert piece in drawn


# ------------------------------------------------------------------------- what the bench must notice


class Planted:
    """A parser with a bug."""

    name = "planted"
    documented: tuple[type[Exception], ...] = (DeviceError,)

    def __init__(self, bug: str) -> None:
        self._bug = bug

    def draw(self, rng: random.Random) -> bytes:
        """Anything."""
        return rng.randbytes(4)

    def take(self, data: bytes) -> bool:
        """Do what must not be done."""
        match self._bug:
            case "crash":
                return bool(data[9])
            case "hang":
                while True:
                    pass
            case "wait":
                time.sleep(30.0)
            case "swallow":
                while True:
                    try:
                        time.sleep(30.0)
                    except Exception:
                        continue
            case "memory":
                return bool(bytearray(8 << 20))
            case "motion":
                raise InvalidMotionError("it drives")
            case "words":
                raise DeviceError("two\nlines")
            case "refuse":
                raise DeviceError("one line")
        return True


def tried(bug: str, probed: bool = False) -> Tally:
    tally = Tally("planted")
    with watchdog():
        try_one(Planted(bug), b"\x01\x02", tally, probed)
    return tally


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """The watchdog barks soon."""
    monkeypatch.setattr(fuzz_harness, "CPU_LIMIT_S", 0.1)
    monkeypatch.setattr(fuzz_harness, "WALL_LIMIT_S", 0.3)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("bug", "kind", "words"),
    [
        ("crash", "crash", "IndexError"),
        ("words", "crash", "not one line"),
        ("hang", "hang", "computing"),
        ("wait", "hang", "waiting"),
        ("swallow", "hang", "waiting"),
        ("motion", "motion", "it drives"),
    ],
)
def test_a_bug_is_noticed_with_its_input(bug: str, kind: str, words: str) -> None:
    tally = tried(bug)
    assert {name: count for name, count in tally.counts.items() if count} == {kind: 1}
    (finding,) = tally.findings
    assert words in finding.words
    assert str(finding).endswith(": 0102")


def test_greed_is_noticed_where_memory_is_traced() -> None:
    tally = tried("memory", probed=True)
    assert tally.counts["memory"] == 1
    assert tally.peak_bytes >= 8 << 20


def test_a_documented_error_is_no_finding() -> None:
    tally = tried("refuse")
    assert not any(tally.counts.values())
    assert (tally.inputs, tally.accepted) == (1, 0)


def test_tallies_add_up_and_keep_the_first_findings() -> None:
    whole = Tally("p")
    for number in range(5):
        part = Tally("p", inputs=10, accepted=3, cpu_s=1.0, slowest_s=0.1 * number, peak_bytes=number)
        part.found("crash", "x", bytes([number]))
        part.found("hang", "y", bytes([number]))
        whole.add(part)
    assert (whole.inputs, whole.accepted, whole.cpu_s, whole.peak_bytes) == (50, 15, 5.0, 4)
    assert whole.slowest_s == pytest.approx(0.4)
    assert (whole.counts["crash"], whole.counts["hang"]) == (5, 5)
    kept = [
        Finding("p", kind, words, bytes([n]))
        for n in range(3)
        for kind, words in (("crash", "x"), ("hang", "y"))
    ]
    assert whole.findings == kept


# --------------------------------------------------------------------------------------- as a program


def ran(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr("sys.argv", ["bench.fuzz", *arguments])
    return fuzz.main()


def test_the_bench_prints_rows_and_bars(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fuzz, "_done", lambda work, jobs: map(fuzz.do, work))
    assert ran(monkeypatch, "--parser", "lcp", "--parser", "nxt-serial", "--inputs", "200", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert [(row["parser"], row["inputs"]) for row in told["rows"]] == [("lcp", 200), ("nxt-serial", 200)]
    assert [bar["name"] for bar in told["bars"] if not bar["holds"]] == []
    assert len(told["bars"]) == 5


def test_too_few_inputs_and_findings_fail_the_bench() -> None:
    tally = Tally("lcp", inputs=10)
    assert [bar.name for bar in fuzz.bars([tally], 11) if not bar.holds] == ["inputs through each parser"]
    tally.found("motion", "it drives", b"")
    assert [bar.name for bar in fuzz.bars([tally], 10) if not bar.holds] == ["motions from invalid input"]


def test_the_work_is_cut_into_pieces_of_the_same_inputs() -> None:
    pieces = list(fuzz.tasks(["lcp"], 3, 12_000))
    assert pieces == [("lcp", 3, 0, 5000), ("lcp", 3, 1, 5000), ("lcp", 3, 2, 2000)]


def test_an_input_is_tried_again_from_its_hex(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ran(monkeypatch, "--replay", "lcp:020b00b81e", "--json") == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["inputs"], row["accepted"]) == (1, 1.0)


def test_processes_do_the_work_with_little_memory() -> None:
    (tally,) = fuzz.measure(["lcp"], seed=1, inputs=50, jobs=1)
    assert (tally.parser, tally.inputs) == ("lcp", 50)
