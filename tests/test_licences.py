"""Nothing under the GPL, AGPL or LGPL runs in the robot: it may be closed, sold and changed (MIT).

nxt-python (GPL) and pymavlink (LGPL) are oracles of the tests only, as programs to compare with.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
COPYLEFT = re.compile(
    r"GNU (?:Lesser |Library |Affero )?(?:Lesser )?General Public|\b[AL]?GPL", re.IGNORECASE
)
EXCEPTION = re.compile(r"with[ -].*exception", re.IGNORECASE)
SHORT_LICENCE_TEXT = 200

# Everything that can be imported of the robot, all it imports when it runs included. `__main__` modules and
# scripts would run; there are none to skip but those whose name says so.
IMPORT_ALL = """
import importlib, json, pkgutil, sys
import calib, robot
failed = {}
for package in (calib, robot):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if module.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(module.name)
        except Exception as error:
            failed[module.name] = f"{type(error).__name__}: {error}"
# What drivers import when they open a device.
for name in ("serial", "usb.core", "usb.util", "pymodbus.client", "pymodbus.server"):
    importlib.import_module(name)
for name in ("gpiozero", "matplotlib.figure", "matplotlib.backends.backend_agg"):
    try:
        importlib.import_module(name)
    except ImportError:
        pass
print(json.dumps({"modules": sorted(sys.modules), "failed": failed}))
"""


@pytest.fixture(scope="module")
def loaded() -> set[str]:
    """Modules of a fresh interpreter that imported the whole robot."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", IMPORT_ALL],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["failed"] == {}
    return set(told["modules"])


def licences(distribution: str) -> list[str]:
    """All the words a distribution's metadata has about its licence, but for whole licence texts."""
    about = metadata.metadata(distribution)
    classifiers = [line for line in about.get_all("Classifier") or [] if line.startswith("License ::")]
    texts = [*(about.get_all("License-Expression") or []), *(about.get_all("License") or [])]
    return classifiers + [text[:SHORT_LICENCE_TEXT] for text in texts]


def is_copyleft(words: str) -> bool:
    """True if it binds what is linked with it: any GPL, without an exception, that one cannot choose away."""
    if EXCEPTION.search(words):
        return False
    choices = re.split(r"\s+OR\s+", words) if "::" not in words else [words]
    return all(COPYLEFT.search(choice) for choice in choices)


def binding(distribution: str) -> bool:
    """True if the licence of this distribution is a binding one."""
    return any(is_copyleft(words) for words in licences(distribution))


@pytest.mark.parametrize(
    ("words", "is_one"),
    [
        ("License :: OSI Approved :: GNU General Public License v3 or later (GPLv3+)", True),
        ("License :: OSI Approved :: GNU Lesser General Public License v3 (LGPLv3)", True),
        ("License :: OSI Approved :: GNU Affero General Public License v3", True),
        ("GPL-3.0-or-later", True),
        ("LGPLv3", True),
        ("AGPL-3.0-only", True),
        ("MIT AND GPL-2.0-only", True),
        ("MIT OR GPL-2.0-only", False),
        ("GPL-2.0-only WITH Classpath-exception-2.0", False),
        ("BSD-3-Clause", False),
        ("License :: OSI Approved :: MIT License", False),
        ("MPL-2.0", False),
    ],
)
def test_a_binding_licence_is_recognised(words: str, is_one: bool) -> None:
    assert is_copyleft(words) == is_one


def test_the_oracles_of_the_tests_would_be_noticed() -> None:
    """Else the test below would hold by being blind."""
    assert binding("nxt-python")
    assert binding("pymavlink")
    assert not binding("pymodbus")


def test_the_whole_robot_loads_nothing_with_a_binding_licence(loaded: set[str]) -> None:
    owners = metadata.packages_distributions()
    tops = {name.partition(".")[0] for name in loaded}
    distributions = {owner for top in tops for owner in owners.get(top, [])}
    assert {"numpy", "pymodbus", "pyserial", "pyusb", "msgspec"} <= distributions
    assert [name for name in sorted(distributions) if binding(name)] == []


def test_every_loaded_distribution_says_what_its_licence_is(loaded: set[str]) -> None:
    owners = metadata.packages_distributions()
    distributions = {o for name in loaded for o in owners.get(name.partition(".")[0], [])} - {"robot"}
    assert [name for name in sorted(distributions) if not licences(name)] == []


@pytest.mark.parametrize("oracle", ["nxt", "pymavlink", "pytest", "hypothesis"])
def test_oracles_and_test_tools_are_not_loaded(loaded: set[str], oracle: str) -> None:
    assert not {name for name in loaded if name.partition(".")[0] == oracle}


def test_the_run_time_dependencies_are_all_permissive() -> None:
    """Also those that only an extra for running brings, and all that they bring along."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *(line for name in ("sim", "plots", "gpio") for line in extras[name])]
    seen: set[str] = set()
    while wanted:
        name = re.split(r"[\s<>=!~;\[(]", wanted.pop(), maxsplit=1)[0].lower().replace("_", "-")
        if name in seen:
            continue
        seen.add(name)
        try:
            assert not binding(name), f"{name}: {licences(name)}"
        except metadata.PackageNotFoundError:
            continue  # for another system
        needs = metadata.requires(name) or []
        wanted += [line for line in needs if "extra ==" not in line]
    assert {"numpy", "mujoco", "matplotlib", "gpiozero", "pymodbus"} <= seen


def test_no_file_of_the_robot_imports_an_oracle() -> None:
    """Also not inside a function that no test calls."""
    imports = re.compile(
        r"^\s*(?:import|from)\s+(?:nxt|pymavlink)\b|import_module\(\s*[\"'](?:nxt|pymavlink)", re.M
    )
    files = [*(ROOT / "robot").rglob("*.py"), *(ROOT / "calib").rglob("*.py")]
    assert len(files) > 100
    assert [str(path) for path in files if imports.search(path.read_text())] == []
