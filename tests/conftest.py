"""Shared by the whole suite: targets taught once, however many workers run the tests."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rich.console import Console

from robot import model_file, taught
from robot.model_file import Model

ModelOf = Callable[[str], Path]


@pytest.fixture(scope="session")
def model_of(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> ModelOf:
    """Path of the model of a simulated object, e.g. `model_of("box")`; the first to ask teaches it."""
    base = tmp_path_factory.getbasetemp()
    shared = (base if worker_id == "master" else base.parent) / "models"
    shared.mkdir(exist_ok=True)

    def model(target: str) -> Path:
        path = shared / f"{target}.model"
        with _locked(shared / f"{target}.lock"):
            if not path.exists():
                quiet = Console(quiet=True)
                lesson = taught.from_studio(target, f"teach-{target}", taught.STUDIO_SEED, quiet)
                model_file.save(path, lesson.model)
        return path

    return model


@pytest.fixture(scope="session")
def box_model(model_of: ModelOf) -> Path:
    """The model file of the simulated box."""
    return model_of("box")


@pytest.fixture(scope="session")
def box(box_model: Path) -> Model:
    """The taught simulated box."""
    return model_file.load(box_model)


@contextmanager
def _locked(path: Path) -> Iterator[None]:
    """One process at a time."""
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield
