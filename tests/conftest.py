"""Shared by the whole suite: targets taught once, however many workers run the tests."""

from __future__ import annotations

import fcntl
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

import pytest
from rich.console import Console

from robot import model_file, taught, teach
from robot.model_file import Model
from robot.vision.window_training import TrainingPlan

ModelOf = Callable[[str], Path]
T = TypeVar("T")


class Once:
    """Makes what is dear once for all workers: the first to ask does, the others wait and read it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(exist_ok=True)

    def file(self, name: str, make: Callable[[Path], None]) -> Path:
        """The file of this name, made by `make` if nobody has."""
        path = self._folder / name
        with _locked(self._folder / f"{name}.lock"):
            if not path.exists():
                make(path)
        return path

    def value(self, name: str, make: Callable[[], T]) -> T:
        """What `make` returns."""
        path = self.file(f"{name}.pickle", lambda path: _dump(make(), path))
        made: T = pickle.loads(path.read_bytes())
        return made


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Once:
    """Shared by all workers of a test session."""
    base = tmp_path_factory.getbasetemp()
    return Once((base if worker_id == "master" else base.parent) / "once")


@pytest.fixture(scope="session")
def model_of(once: Once) -> ModelOf:
    """Path of the model of a simulated object, e.g. `model_of("box")`."""

    def taught_model(target: str, path: Path) -> None:
        lesson = taught.from_studio(target, f"teach-{target}", taught.STUDIO_SEED, Console(quiet=True))
        model_file.save(path, lesson.model)

    return lambda target: once.file(f"{target}.model", partial(taught_model, target))


@pytest.fixture(scope="session")
def box_model(model_of: ModelOf) -> Path:
    """The model file of the simulated box."""
    return model_of("box")


@pytest.fixture(scope="session")
def box(box_model: Path) -> Model:
    """The taught simulated box."""
    return model_file.load(box_model)


@pytest.fixture
def short_lessons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands that teach learn little: enough where only the way from command to file is asked for."""
    little = TrainingPlan(30.0, places=300, drawn=3, rounds=1)
    monkeypatch.setattr(taught.teach, "teach", partial(teach.teach, lesson=little))


def _dump(value: object, path: Path) -> None:
    path.write_bytes(pickle.dumps(value))


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """One process at a time."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
