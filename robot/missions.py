"""What the commands do: run scenes, print tables, leave records."""

from __future__ import annotations

import json
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from robot import model_file, taught
from robot.errors import UserError
from robot.faults import TABLE
from robot.run_recorded import SimJob, run_recorded
from robot.run_sim import SimOptions
from robot.sim.injected import KINDS, InjectedFault
from robot.sim.scene import Scene, load_scene, shipped_scenes
from robot.teach import found_words
from robot.told_faults import ToldFault, split_fault

RUNS = Path("runs")
DONE, FAILED = 0, 1
CAMERAS = "cameras"
TABLE_WIDTH = 160
GOOD_SHARE = 0.8  # of its seeds a scene must succeed with


def demo(seed: int, video: bool) -> int:
    """The whole robot in one mission, with pictures; a plain sentence at the end."""
    console = _console()
    job = _job(load_scene("demo"), "demo", seed, SimOptions(), video, None, console)
    report = next(_run_all([job], 1, console))
    _print_outcome(report, console)
    return DONE if report["success"] else FAILED


def run_sim(
    scene: str,
    seeds: Sequence[int],
    jobs: int,
    as_json: bool,
    video: bool,
    slow: float,
    faults: Sequence[str],
    config: Path | None,
    wire: bool = False,
) -> int:
    """Run scenes with seeds; a table for people, JSON for programs. wire: in real time, over real links."""
    console = _console()
    names = shipped_scenes() if scene == "all" else (scene,)
    options = SimOptions(slow, *parse_faults(faults))
    work = [
        _job(load_scene(name), name, seed, options, video, config, console)
        for name in names
        for seed in seeds
    ]
    reports = list(_run_wired(work, console) if wire else _run_all(work, jobs, console))
    if as_json:
        json.dump(reports[0] if len(reports) == 1 else {"runs": reports}, sys.stdout, indent=2)
        print()
    if len(reports) == 1:
        _print_outcome(reports[0], console)
        return DONE if reports[0]["success"] or reports[0].get("stopped") else FAILED
    if reports[-1].get("stopped"):
        return DONE
    good = _print_table(names, reports, console)
    return DONE if good else FAILED


def _console() -> Console:
    """Standard error; where no terminal says how wide it is (a log, a pipe), wide enough for the table."""
    console = Console(stderr=True)
    return console if console.is_terminal else Console(stderr=True, width=TABLE_WIDTH)


def parse_faults(texts: Sequence[str]) -> tuple[tuple[InjectedFault, ...], tuple[ToldFault, ...]]:
    """What is to be broken, and what can only be told. Raises UserError."""
    faults = [parse_fault(text) for text in texts]
    broken = tuple(fault for fault in faults if isinstance(fault, InjectedFault))
    return broken, tuple(fault for fault in faults if isinstance(fault, ToldFault))


def parse_fault(text: str) -> InjectedFault | ToldFault:
    """A fault from 'device.kind@time[:duration]': broken if the simulated world can, else only told.

    Raises UserError.
    """
    device, kind, at, duration = split_fault(text)
    try:
        if kind in KINDS.get(device, ()):
            return InjectedFault(device, kind, at, duration)
        if f"{device}.{kind}" in TABLE:
            return ToldFault(device, kind, at, duration)
    except UserError as error:
        raise UserError(f"--fault {text!r}: {error}") from None
    there = {f"{name}.{each}" for name, kinds in KINDS.items() for each in kinds} | TABLE.keys()
    raise UserError(f"--fault {text!r}: no such fault; there are: {', '.join(sorted(there))}")


def _job(
    scene: Scene,
    name: str,
    seed: int,
    options: SimOptions,
    video: bool,
    config: Path | None,
    console: Console,
) -> SimJob:
    return SimJob(name, seed, taught.model_for(scene.taught_object, console), options, video, config)


def _run_all(work: Sequence[SimJob], jobs: int, console: Console) -> Iterator[dict[str, Any]]:
    """Reports in the order of the work, with a progress bar on standard error."""
    started = datetime.now()
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[words]}"),
        TimeElapsedColumn(),
    )
    quiet = not console.is_terminal  # a bar that cannot move is only noise in a log
    with Progress(*columns, console=console, transient=True, disable=quiet) as progress:
        if len(work) == 1:
            bar = progress.add_task(f"{work[0].scene}, seed {work[0].seed}", total=1.0, words="")
            yield run_recorded(
                work[0],
                RUNS,
                started,
                lambda share, words: progress.update(bar, completed=share, words=words),
            )
            return
        bar = progress.add_task("runs", total=len(work), words="")
        context = multiprocessing.get_context("spawn")  # each run its own process: no shared OpenGL context
        with ProcessPoolExecutor(jobs, mp_context=context) as pool:
            futures: list[Future[dict[str, Any]]] = [
                pool.submit(run_recorded, job, RUNS, started, None) for job in work
            ]
            for future in as_completed(futures):
                report = future.result()
                verdict = "done" if report["success"] else "failed"
                words = f"{report['scene']} seed {report['seed']}: {verdict}"
                progress.update(bar, advance=1, words=words)
        for future in futures:
            yield future.result()


def _run_wired(work: Sequence[SimJob], console: Console) -> Iterator[dict[str, Any]]:
    """One run after the other in real time; SIGTERM and Ctrl-C end the present one and those to come."""
    from robot.run_hardware import stopped_by_signals
    from robot.run_wire import run_wire

    started = datetime.now()
    stop = threading.Event()
    with stopped_by_signals(stop):
        for job in work:
            console.print(f"{job.scene}, seed {job.seed}: in real time ...", soft_wrap=True)
            yield run_wire(job, RUNS, started, None, stop)
            if stop.is_set():
                return


def _print_outcome(report: dict[str, Any], console: Console) -> None:
    verdict = "[green]Mission done[/]" if report["success"] else "[red]Mission failed[/]"
    console.print(f"{verdict}: {report['reason']}", soft_wrap=True)
    console.print(
        f"Report, events, video and trajectory: {report['folder']} (also {RUNS}/latest)", soft_wrap=True
    )


def _print_table(names: Sequence[str], reports: Sequence[dict[str, Any]], console: Console) -> bool:
    """One row a scene; True if all scenes are good and nothing collided."""
    table = Table(
        "scene",
        "done",
        "found s",
        "range error",
        "in view",
        "at distance",
        "SPL",
        "collisions",
        "clearance m",
        "false",
        "why not",
    )
    all_good = True
    for name in names:
        rows = [report for report in reports if report["scene"] == load_scene(name).name]
        done = sum(bool(report["success"]) for report in rows)
        good = done >= GOOD_SHARE * len(rows)
        all_good &= good and not any(report["collisions"] for report in rows)
        why = "; ".join(dict.fromkeys(f"{r['seed']}: {r['reason']}" for r in rows if not r["success"]))
        table.add_row(
            name,
            f"[{'green' if good else 'red'}]{done}/{len(rows)}[/]",
            _median(rows, "found_s", 1),
            _median(rows, "range_error_median", 3),
            _median(rows, "in_view", 2),
            _median(rows, "at_distance", 2),
            _median(rows, "spl", 2),
            str(sum(r["collisions"] for r in rows)),
            _least(rows, "clearance_min"),
            str(sum(r["false_detections"] for r in rows)),
            why,
        )
    console.print(table)
    return all_good


def _median(rows: Sequence[dict[str, Any]], key: str, decimals: int) -> str:
    values = sorted(row[key] for row in rows if row.get(key) is not None)
    return f"{values[len(values) // 2]:.{decimals}f}" if values else "-"


def _least(rows: Sequence[dict[str, Any]], key: str) -> str:
    values = [row[key] for row in rows if row.get(key) is not None]
    return f"{min(values):.2f}" if values else "-"


def teach_target(
    source: str, name: str, box: str | None, out: Path | None, seed: int, eyes: Path | None, seconds: float
) -> int:
    """Teach a target from a folder, a video, the robot's cameras (source 'cameras', config file `eyes`) or a
    simulated studio; writes the model and its contact sheet."""
    import cv2

    console = _console()
    out = out or taught.FOLDER / f"{_file_name(name)}.model"
    _check_writable(out)
    path = Path(source)
    if source == CAMERAS:
        if eyes is None:
            raise UserError("--from cameras: say which with --config FILE, the robot's config")
        lesson = taught.from_eyes(name, eyes, seconds, seed, console)
    elif path.is_dir() or (path.is_file() and path.suffix != ".toml"):
        lesson = taught.from_pictures(name, path, taught.parse_box(box) if box else None, seed, console)
    else:
        load_scene(source)  # a clear error for what is neither folder, video nor scene
        lesson = taught.from_studio(name, source, seed, console)
    model_file.save(out, lesson.model)
    console.print(f"{name}: {lesson.summary()}", soft_wrap=True, markup=False)
    console.print(found_words(lesson.validation), soft_wrap=True, markup=False)
    for warning in lesson.warnings:
        console.print(f"[yellow]mind:[/] {warning}", soft_wrap=True)
    sheet = out.with_suffix(".png")
    drawn = cv2.imwrite(str(sheet), lesson.contact_sheet)
    console.print(
        f"model {out}, " + (f"contact sheet {sheet}" if drawn else f"no contact sheet: cannot write {sheet}")
    )
    return DONE


def _file_name(name: str) -> str:
    """The target's name as a file's. Raises UserError for one that would lead into another folder."""
    if not name.strip() or name in (".", "..") or "/" in name or "\\" in name:
        raise UserError(
            f"--name {name!r}: cannot be a file's name; choose another, or say where with --out FILE"
        )
    return name


def _check_writable(out: Path) -> None:
    """Say before the work, not after it, that the model has no place. Makes the default folder if need be."""
    if out.suffix.lower() == ".png":
        raise UserError(f"--out {out}: the contact sheet takes that name; let the model's end in .model")
    if out.parent == taught.FOLDER:
        taught.make_folder()
    if out.is_dir() or not os.access(out.parent, os.W_OK | os.X_OK) or not out.parent.is_dir():
        raise UserError(f"--out {out}: cannot be written there; name a file in a folder that exists")
