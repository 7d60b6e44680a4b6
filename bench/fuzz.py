"""Random and spoiled inputs through every parser: no crash, no hang, no greed, no motion from invalid frames.

20,000 inputs a parser, with --full 1,000,000. Inputs follow from --seed alone, however many --jobs there are.
Each has 2 s of computing; one in a hundred has its memory traced (1 MB and 512 bytes for each byte of input).
`motions`: words that move, take or give, and commands to arm or motor, that an independent recogniser finds
nothing valid for. `accepted`: the share of inputs that were taken as valid, wholly or in part.
An input that failed is printed as hex; --replay PARSER:HEX tries it again.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from typing import Any, Final

from bench.fuzz_arm import ArmRegisters
from bench.fuzz_files import CalibrationFile, ConfigFile, ModelFile, SceneFile
from bench.fuzz_harness import CHUNK, KINDS, Subject, Tally, limit_memory, run_chunk, try_one, watchdog
from bench.fuzz_modbus import ModbusReplies
from bench.fuzz_nxt import BrickClient, Emulator, LcpReplies, SerialFraming
from bench.fuzz_teleop import Mavlink, Teleop
from bench.fuzz_webcam import Addresses, ControlList, HttpHead, Multipart
from bench.report import Bar, arguments, publish

SHORT: Final = 20_000
FULL: Final = 1_000_000

SUBJECTS: Final[dict[str, Callable[[], Subject]]] = {
    "lcp": LcpReplies,
    "brick": BrickClient,
    "nxt-serial": SerialFraming,
    "brick-emulator": Emulator,
    "teleop": Teleop,
    "mavlink": Mavlink,
    "modbus-tcp": partial(ModbusReplies, rtu=False),
    "modbus-rtu": partial(ModbusReplies, rtu=True),
    "arm": ArmRegisters,
    "multipart": Multipart,
    "http-head": HttpHead,
    "http-controls": ControlList,
    "address": Addresses,
    "config": ConfigFile,
    "scene": SceneFile,
    "calibration": CalibrationFile,
    "model": ModelFile,
}
"""Every parser of what comes from outside, by the name of its row."""

_Task = tuple[str, int, int, int]


@cache
def _subject(name: str) -> Subject:
    return SUBJECTS[name]()


def tasks(names: Sequence[str], seed: int, inputs: int) -> Iterator[_Task]:
    """The work in pieces: parser, seed, number of the chunk, inputs in it."""
    for name in names:
        for index in range(-(-inputs // CHUNK)):
            yield name, seed, index, min(CHUNK, inputs - index * CHUNK)


def do(task: _Task) -> Tally:
    """One piece of the work."""
    name, seed, index, count = task
    return run_chunk(_subject(name), seed, index, count)


def measure(names: Sequence[str], seed: int, inputs: int, jobs: int) -> list[Tally]:
    """Put `inputs` inputs through each of the parsers; one tally each, in their order."""
    tallies = {name: Tally(name) for name in names}
    for tally in _done(tasks(names, seed, inputs), jobs):
        whole = tallies[tally.parser]
        whole.add(tally)
        if whole.inputs == inputs:
            print(f"{whole.parser}: {whole.inputs} inputs in {whole.cpu_s:.0f} s", file=sys.stderr)
    return list(tallies.values())


def _done(work: Iterable[_Task], jobs: int) -> Iterator[Tally]:
    """In processes of their own also for one job, for their memory is limited."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=limit_memory) as pool:
        yield from pool.map(do, work)


def row(tally: Tally) -> dict[str, Any]:
    """A parser's figures."""
    return {
        "parser": tally.parser,
        "inputs": tally.inputs,
        "cpu_s": round(tally.cpu_s, 1),
        "crashes": tally.counts["crash"],
        "hangs": tally.counts["hang"],
        "motions": tally.counts["motion"],
        "greedy": tally.counts["memory"],
        "accepted": round(tally.accepted / max(tally.inputs, 1), 3),
        "slowest_ms": round(1e3 * tally.slowest_s, 1),
        "peak_kib": round(tally.peak_bytes / 1024, 1),
    }


def bars(tallies: Sequence[Tally], inputs: int) -> list[Bar]:
    """Nothing of what must not happen, and as many inputs through each as were wanted."""
    words = {
        "crash": "crashes",
        "hang": "hangs",
        "motion": "motions from invalid input",
        "memory": "greedy inputs",
    }
    never = [Bar(words[kind], sum(tally.counts[kind] for tally in tallies), 0.0) for kind in KINDS]
    fewest = min(tally.inputs for tally in tallies)
    return [*never, Bar("inputs through each parser", fewest, inputs, at_most=False)]


def replay(name: str, data: bytes) -> Tally:
    """Try one input again, in this process."""
    tally = Tally(name)
    with watchdog():
        try_one(_subject(name), data, tally)
    return tally


def main() -> int:
    """Run and print; what failed goes to standard error, as hex."""
    options = _options().parse_args()
    if options.replay is not None:
        name, _, text = options.replay.partition(":")
        tallies = [replay(name, bytes.fromhex(text))]
        inputs = 1
    else:
        inputs = options.inputs or (FULL if options.full else SHORT)
        tallies = measure(options.parser or list(SUBJECTS), options.seed, inputs, options.jobs)
    for tally in tallies:
        for finding in tally.findings:
            print(f"seed {options.seed}: {finding}", file=sys.stderr)
    return publish("fuzz", [row(tally) for tally in tallies], bars(tallies, inputs), options.json)


def _options() -> argparse.ArgumentParser:
    parser = arguments(__doc__ or "")
    parser.add_argument("--seed", type=int, default=1, help="everything random follows from it")
    parser.add_argument("--parser", action="append", choices=list(SUBJECTS), help="only this one; repeatable")
    parser.add_argument("--inputs", type=int, help="so many inputs through each parser")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--replay", metavar="PARSER:HEX", help="try one input again")
    return parser


if __name__ == "__main__":
    sys.exit(main())
