"""Whatever optional piece is missing, one line says what to install, and the exit code is 2."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot import model_file
from robot.messages import Box
from robot.model_file import Model
from robot.vision.finder_training import fit
from robot.vision.view_warps import View
from robot.vision.window_training import TrainingPlan

ROOT = Path(__file__).parents[1]

# Runs at the start of every Python whose path has it, child processes included.
ABSENCE = """
import ctypes.util, os, sys

class Absent:
    names = tuple(filter(None, os.environ.get("ABSENT_MODULES", "").split(",")))

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self.names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())

found = ctypes.util.find_library
absent = tuple(filter(None, os.environ.get("ABSENT_LIBRARIES", "").split(",")))
ctypes.util.find_library = lambda name: None if name.startswith(absent or ("?",)) else found(name)
"""
OPTIONAL = "mujoco,matplotlib,gpiozero,evdev,nxt,pymavlink,psutil,skimage,sklearn,hypothesis"
"""All that pyproject lists in an extra, and evdev, which somebody might expect."""


class Machine:
    """A computer without some packages, and a folder on it to work in."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "site").mkdir()
        (folder / "site" / "sitecustomize.py").write_text(ABSENCE)

    def robot(
        self, *arguments: str, modules: str = "", libraries: str = ""
    ) -> subprocess.CompletedProcess[str]:
        """`robot ...` without these top-level modules and shared libraries."""
        path = os.pathsep.join([str(self.folder / "site"), str(ROOT)])
        absent = {"ABSENT_MODULES": modules, "ABSENT_LIBRARIES": libraries, "PYTHONPATH": path}
        return subprocess.run(
            [sys.executable, "-m", "robot.cli", *arguments],
            env=os.environ | absent,
            cwd=self.folder,
            capture_output=True,
            text=True,
            timeout=120,
        )

    def write(self, name: str, text: str) -> str:
        """A file in the folder; returns its name."""
        (self.folder / name).write_text(text)
        return name

    def config(self, table: str) -> str:
        """A config that is good but for what `table` says."""
        rng = np.random.default_rng(0)
        poster = cv2.resize(rng.integers(0, 255, (8, 6, 3), np.uint8), (60, 80))
        wall = cv2.resize(rng.integers(90, 160, (9, 12, 3), np.uint8), (352, 288))
        views = [cv2.convertScaleAbs(poster, alpha=gain) for gain in (0.5, 0.6, 0.7, 0.8, 0.9, 1.0)]
        looks = [View(picture, Box(0, 0, 60, 80)) for picture in views]
        taught = fit(looks, [wall], "poster", seed=0, lesson=TrainingPlan(30.0, 300, 3, rounds=1)).finder
        model_file.save(self.folder / "poster.model", Model("poster", taught, len(views)))
        return self.write("robot.toml", f'[vision]\nmodel = "poster.model"\n{table}')


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def is_one_hint(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """One line on standard error with these words, nothing else, exit code 2."""
    said = done.stdout + done.stderr
    assert done.returncode == 2, said
    assert "Traceback" not in said
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert done.stderr.startswith("robot: ")
    for word in words:
        assert word in done.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "--sim", "standing"),
        ("run", "--sim", "standing", "--wire"),
        ("demo",),
        ("teach", "--from", "teach-box", "--name", "box"),
    ],
    ids=["run --sim", "run --sim --wire", "demo", "teach"],
)
def test_without_mujoco_the_simulator_names_its_extra(machine: Machine, arguments: tuple[str, ...]) -> None:
    done = machine.robot(*arguments, modules="mujoco")
    is_one_hint(done, "the simulator is not installed", "pip install 'robot[sim]'")
    assert not (machine.folder / "runs").exists()


def test_without_matplotlib_a_run_names_its_extra(machine: Machine, box_model: Path) -> None:
    (machine.folder / "models").mkdir()
    shutil.copy(box_model, machine.folder / "models" / "box.model")
    scene = machine.write("short.toml", 'duration_s = 1.0\nexpect = "not found"\n')
    done = machine.robot("run", "--sim", scene, modules="matplotlib")
    is_one_hint(done, "no plot without matplotlib", "pip install", "robot[plots]")
    assert not (machine.folder / "runs").exists(), "told before the run, not after it"


def test_without_gpiozero_the_lamp_names_it(machine: Machine) -> None:
    config = machine.config('[lamp]\ndriver = "gpiozero"\ndevice = "GPIO18"\n')
    done = machine.robot("run", "--config", config, "--duration", "0.2", modules="gpiozero")
    is_one_hint(done, "lamp", "gpiozero is not installed", "pip install gpiozero")


def test_without_libusb_the_brick_names_the_package(machine: Machine) -> None:
    config = machine.config('[base]\ndriver = "nxt-usb"\n')
    done = machine.robot("run", "--config", config, "--duration", "0.2", libraries="usb,libusb,openusb")
    is_one_hint(done, "base", "libusb-1.0", "install the package libusb-1.0-0")


def test_without_anything_optional_the_robot_runs_on_its_own_devices(machine: Machine) -> None:
    """Mocks stand in for the devices; everything else is what runs on the hardware."""
    config = machine.config('[teleop]\ndriver = "mock"\n')
    done = machine.robot("run", "--config", config, "--duration", "0.4", modules=OPTIONAL)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    (events,) = (machine.folder / "runs").glob("2*/events.jsonl")
    assert events.stat().st_size > 0


@pytest.mark.parametrize(
    "arguments", [("--help",), ("config", "show"), ("faults",), ("chart",)], ids=lambda given: given[0]
)
def test_without_anything_optional_the_pages_are_printed(
    machine: Machine, arguments: tuple[str, ...]
) -> None:
    done = machine.robot(*arguments, modules=OPTIONAL)
    assert done.returncode == 0, done.stderr
    assert done.stdout
