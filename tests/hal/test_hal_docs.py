"""The examples in the docstrings of the hardware layer run."""

from __future__ import annotations

import doctest
import importlib
import pkgutil

import pytest

import robot.hal

MODULES = [module.name for module in pkgutil.walk_packages(robot.hal.__path__, "robot.hal.")]


@pytest.mark.parametrize("name", MODULES)
def test_examples(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0
