"""What the virtual machine boots: a Debian root with its kernel, the wheels, and this repository on top.

Root and wheels are built once and kept under build/kernel until what they are made of changes; the repository
is laid over them anew for each run.
"""

from __future__ import annotations

import hashlib
import shlex
import shutil
import stat
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from cpio import CpioWriter

HERE: Final = Path(__file__).resolve().parent
REPOSITORY: Final = HERE.parents[1]
SUITE: Final = "bookworm"
GUEST_PYTHON: Final = "3.11"
DEBIAN_PACKAGES: Final = ("python3", "mount", "udev", "kmod", "v4l-utils", "usbutils", "libusb-1.0-0")
TEST_WHEELS: Final = ("pytest>=8.2", "hypothesis>=6.100")
KINDS: Final = ("base", "camera")
_SUITE_PARTS: Final = ("conftest.py", "driver_rigs.py", "rig.py", "test_contract_devices.py")
_EXCLUDED: Final = ("/usr/share/doc/*", "/usr/share/man/*", "/usr/share/locale/*", "/usr/share/info/*")
_LEFT_OUT: Final = ("dev", "proc", "sys", "tmp", "run", "var/cache", "var/lib/apt", "usr/share/perl")


class TierError(Exception):
    """The tier cannot run here; the message names the cure."""


@dataclass(frozen=True, slots=True)
class Image:
    """Files for the boot loader."""

    kernel: Path
    initrd: Path


def check_tools() -> None:
    """Raises TierError if a program the tier needs is missing."""
    needed = {"qemu-system-x86_64": "qemu-system-x86", "mmdebstrap": "mmdebstrap"}
    missing = [package for program, package in needed.items() if shutil.which(program) is None]
    if missing:
        raise TierError(f"the kernel tier needs {' and '.join(missing)}: apt-get install {' '.join(missing)}")


def prepare(build: Path, orders: dict[str, str]) -> Image:
    """Return a bootable image of the repository as it is now; `build` holds what is kept between runs.

    orders: file name -> contents, for the guest's /srv/orders of this run.

    Raises TierError if the root cannot be built, with the last line of the tool that failed.
    """
    wheels = _wheels()
    kept = build / _recipe(wheels)
    if not (kept / "done").exists():
        print(f"Building the guest's root in {build}, once; this takes a minute or two ...", flush=True)
        _build(kept, wheels)
        _forget_others(build, kept)
    initrd = build / "initrd"
    _lay_over(kept / "root.cpio", initrd, orders)
    return Image(kept / "vmlinuz", initrd)


def _wheels() -> tuple[str, ...]:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    return (*project["dependencies"], *TEST_WHEELS)


def _recipe(wheels: tuple[str, ...]) -> str:
    """A name for everything the root is made of."""
    text = "\n".join((SUITE, *DEBIAN_PACKAGES, *wheels, *_EXCLUDED, *_LEFT_OUT))
    sources = b"".join((HERE / name).read_bytes() for name in ("root_hook", "cpio.py"))
    return "root-" + hashlib.sha256(text.encode() + sources).hexdigest()[:12]


def _build(kept: Path, wheels: tuple[str, ...]) -> None:
    shutil.rmtree(kept, ignore_errors=True)
    kept.mkdir(parents=True)
    with tempfile.TemporaryDirectory(dir=kept) as name:
        scratch = Path(name)
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--only-binary=:all:"]
        _run([*pip, "--python-version", GUEST_PYTHON, "--target", str(scratch / "site"), *wheels])
        # Both run wherever mmdebstrap makes the root, also in a namespace that cannot see this folder.
        hooks = [f"copy-in {shlex.quote(str(scratch / 'site'))} /opt", (HERE / "root_hook").read_text()]
        excluded = [f"--dpkgopt=path-exclude={pattern}" for pattern in _EXCLUDED]
        bootstrap = ["mmdebstrap", "--quiet", "--variant=apt", f"--include={','.join(DEBIAN_PACKAGES)}"]
        customized = [f"--customize-hook={hook}" for hook in hooks]
        _run([*bootstrap, *excluded, *customized, SUITE, str(scratch / "root.tar")])
        with tarfile.open(scratch / "root.tar") as archive:
            kernel = next(member for member in archive if member.name.endswith("boot/vmlinuz"))
            source = archive.extractfile(kernel)
            assert source is not None
            (kept / "vmlinuz").write_bytes(source.read())
            with (kept / "root.cpio").open("wb") as file:
                CpioWriter(file).add_tar(archive, leave_out=(*_LEFT_OUT, "boot"))
    (kept / "done").touch()


def _run(command: list[str]) -> None:
    try:
        subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["no word"])[-1]
        cure = "check the network and the package sources, then try again"
        raise TierError(f"{Path(command[0]).name} failed: {last}; {cure}") from error


def _forget_others(build: Path, kept: Path) -> None:
    for folder in build.glob("root-*"):
        if folder != kept:
            shutil.rmtree(folder)


def _lay_over(root: Path, initrd: Path, orders: dict[str, str]) -> None:
    """The kernel unpacks archives one after the other: first the root, then the repository."""
    shutil.copyfile(root, initrd)
    with initrd.open("ab") as file:
        cpio = CpioWriter(file)
        for folder in ("robot", "calib", "tests/kernel"):
            cpio.add_parents(f"srv/{folder}")
            cpio.add_folder(REPOSITORY / folder, f"srv/{folder}")
        cpio.add("srv/tests/contract", stat.S_IFDIR | 0o755)
        for path in _contract_files():
            cpio.add_file(path, f"srv/tests/contract/{path.name}")
        cpio.add_file(REPOSITORY / "pyproject.toml", "srv/pyproject.toml")
        cpio.add("srv/orders", stat.S_IFDIR | 0o755)
        for name, text in orders.items():
            cpio.add(f"srv/orders/{name}", stat.S_IFREG | 0o644, text.encode())
        cpio.add_file(HERE / "guest" / "init", "init")
        cpio.finish()


def _contract_files() -> list[Path]:
    """The suites of the guest's kinds of device, and of all rigs only its own: others need more wheels."""
    contract = REPOSITORY / "tests" / "contract"
    suites = [path for kind in KINDS for path in contract.glob(f"test_contract_{kind}*.py")]
    return [*(contract / name for name in _SUITE_PARTS), *suites, *(HERE / "guest").glob("rigs_kernel_*.py")]
