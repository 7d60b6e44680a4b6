"""Every driver there is, by kind and name, gathered from the modules rigs_*.py beside this one.

Each has MAKERS, kind -> name -> rig maker, and may have REAL, kind -> a function from an address to the
maker of a rig before a real device (None: this sort of address is somebody else's). The driver "none"
stands for a device that is not there.
"""

from __future__ import annotations

import importlib
from collections import defaultdict
from pathlib import Path

from rig import Make

_MODULES = [importlib.import_module(path.stem) for path in sorted(Path(__file__).parent.glob("rigs_*.py"))]


def makers() -> dict[str, dict[str, Make]]:
    """All rigs with a far end in the test's hand: kind -> name -> maker."""
    found: dict[str, dict[str, Make]] = defaultdict(dict)
    for module in _MODULES:
        for kind, named in module.MAKERS.items():
            found[kind].update(named)
    return dict(found)


def real(kind: str, address: str) -> Make:
    """A rig before a real device. Raises ValueError if no driver of this kind takes the address."""
    for module in _MODULES:
        reach = getattr(module, "REAL", {}).get(kind)
        make: Make | None = reach(address) if reach is not None else None
        if make is not None:
            return make
    raise ValueError(f"--hardware {kind}={address}: no driver of this kind takes such an address")


MAKERS = makers()
