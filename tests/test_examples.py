"""Every example in a docstring does what it says."""

import doctest
import importlib
import pkgutil

import pytest

import calib
import robot

MODULES = sorted(
    found.name
    for package in (robot, calib)
    for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
)


@pytest.mark.parametrize("name", [name for name in MODULES if not name.endswith("__main__")])
def test_the_examples_of_a_module_hold(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0
