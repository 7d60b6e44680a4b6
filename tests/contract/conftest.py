"""Runs every contract over every driver of its kind.

Mock and emulated drivers always; real ones with `pytest tests/contract --hardware KIND=ADDRESS` (repeatable;
put a base on blocks first: its wheels will turn).
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from driver_rigs import MAKERS, real
from rig import Make, Rig


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option for real devices."""
    parser.addoption(
        "--hardware",
        action="append",
        default=[],
        metavar="KIND=ADDRESS",
        help="also test this real device, e.g. base=usb, base=/dev/rfcomm0",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Fixture KIND: every driver. live_KIND: those with a device. breakable_KIND: those tests can break."""
    for kind, makers in MAKERS.items():
        live = {name: make for name, make in makers.items() if name != "none"}
        there = _real_ones(metafunc.config, kind)
        for fixture, drivers in {
            kind: makers | there,
            f"live_{kind}": live | there,
            f"breakable_{kind}": live,
        }.items():
            if fixture in metafunc.fixturenames:
                metafunc.parametrize(fixture, drivers.values(), ids=drivers.keys(), indirect=True)


def _real_ones(config: pytest.Config, kind: str) -> dict[str, Make]:
    words = [word.partition("=") for word in config.getoption("--hardware", default=[])]
    return {f"real {address}": real(kind, address) for name, _, address in words if name == kind}


def _rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Rig[Any]]:
    rig = request.param(tmp_path)
    yield rig
    rig.device.close()


for _kind in MAKERS:
    for _name in (_kind, f"live_{_kind}", f"breakable_{_kind}"):
        globals()[_name] = pytest.fixture(_rig, name=_name)
