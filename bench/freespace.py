"""Does the robot call safe only what is: random simulator views with truth, judged kind by kind.

`python -m bench.freespace [--views 200] [--kind K ...] [--jobs 2] [--cache DIR] [--json] [--show N OUT.png]`.
Never safe where the body does not fit, safe in 98 % of gaps 15 % wider, passage within 5 % and its centre
within 10 mm at 0.25 m (hand) or 3 % at 1 m (base), free floor never beyond an obstacle; and no bare board
across a gap passed. Exit code 0 if all bars hold.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2

from bench.freespace_bars import bars, rows, worst_first
from bench.freespace_boards import BOARD_KINDS, board_bars, board_rows, passed
from bench.freespace_judge import Verdict, judge
from bench.freespace_percept import finder_for
from bench.freespace_sheet import sheet
from bench.freespace_views import KINDS, FreeSpaceView, view
from bench.report import arguments, publish
from robot.errors import UserError
from robot.messages import FreeSpace

Task = tuple[str, int, Path | None]
Answer = TypeVar("Answer")
VIEWS, FIRST_SEED = 200, 1
CHUNK = 8


def looked_at(kind: str, seed: int, cache: Path | None) -> tuple[FreeSpaceView, FreeSpace]:
    """One view and what the robot finds in it."""
    given = view(kind, seed, cache)
    return given, finder_for(kind)(given.left, given.right, given.pan, given.tilt)


def verdict_on(task: Task) -> Verdict:
    """The verdict on one view: the work of one job."""
    return judge(*looked_at(*task))


def answers(asked: Callable[[Task], Answer], tasks: Sequence[Task], jobs: int) -> Iterator[Answer]:
    """What is answered to all tasks, in order. jobs: processes that share the work; 1: this one does it."""
    if jobs == 1:
        yield from map(asked, tasks)
        return
    # Spawned, not forked: each process makes its own graphics context.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(asked, tasks, chunksize=CHUNK)


def show(judged: Sequence[Verdict], count: int, out: Path, cache: Path | None) -> None:
    """Draw the `count` worst views into one picture.

    Raises:
        UserError: the picture cannot be written.
    """
    worst = worst_first(judged)[:count]
    picture = sheet([(*looked_at(v.kind, v.seed, cache), v) for v in worst])
    try:
        written = cv2.imwrite(str(out), picture)
    except cv2.error:
        written = False
    if not written:
        raise UserError(f"cannot write {out}: is the folder there and the ending a picture's, as .png?")


def _options(words: Sequence[str] | None) -> argparse.Namespace:
    parser = arguments(__doc__ or "")
    parser.add_argument("--views", type=int, default=VIEWS, help="views of each kind")
    parser.add_argument("--kind", action="append", choices=KINDS, help="only this kind; may be given again")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first view")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--cache", type=Path, help="folder that keeps drawn views; none by default")
    parser.add_argument("--show", nargs=2, metavar=("N", "OUT"), help="draw the N worst views into OUT")
    options = parser.parse_args(words)
    if options.views < 1 or options.jobs < 1 or options.seed < 0:
        parser.error("--views and --jobs must be 1 or more, --seed 0 or more")
    if options.show and not (options.show[0].isdigit() and int(options.show[0])):
        parser.error(f"--show N OUT: N must be a whole number above 0, got {options.show[0]}")
    return options


def _unknown(figure: object) -> bool:
    return isinstance(figure, float) and math.isnan(figure)


def main(words: Sequence[str] | None = None) -> int:
    """Run the bench; returns the exit code."""
    options = _options(words)
    cv2.setNumThreads(1)
    seeds = range(options.seed, options.seed + options.views)
    tasks = [(kind, seed, options.cache) for kind in options.kind or KINDS for seed in seeds]
    try:
        judged = list(answers(verdict_on, tasks, options.jobs))
        crossed = [task for task in tasks if task[0] in BOARD_KINDS]
        boarded = list(zip((t[0] for t in crossed), answers(passed, crossed, options.jobs), strict=True))
        if options.show:
            show(judged, int(options.show[0]), Path(options.show[1]), options.cache)
    except UserError as problem:
        print(problem, file=sys.stderr)
        return 2
    figures = rows(judged)
    told = [{key: figure for key, figure in row.items() if not _unknown(figure)} for row in figures]
    boards = board_rows(BOARD_KINDS, boarded)
    return publish("freespace", [*told, *boards], [*bars(figures), *board_bars(boards)], options.json)


if __name__ == "__main__":
    raise SystemExit(main())
