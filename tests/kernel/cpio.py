"""Archives the kernel unpacks as its first root file system ("newc" format), written without being root."""

from __future__ import annotations

import stat
import tarfile
from pathlib import Path, PurePosixPath
from typing import IO

_TYPES = {
    tarfile.REGTYPE: stat.S_IFREG,
    tarfile.DIRTYPE: stat.S_IFDIR,
    tarfile.SYMTYPE: stat.S_IFLNK,
    tarfile.CHRTYPE: stat.S_IFCHR,
    tarfile.BLKTYPE: stat.S_IFBLK,
    tarfile.FIFOTYPE: stat.S_IFIFO,
}


class CpioWriter:
    """Writes members to a binary file; everything belongs to root. Call `finish` last."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._inode = 0

    def add(self, name: str, mode: int, data: bytes = b"", device: tuple[int, int] = (0, 0)) -> None:
        """Add one member. mode with its file type; data of a file, or a link's target."""
        self._inode += 1
        path = name.encode() + b"\0"
        numbers = (self._inode, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(path), 0)
        header = b"070701" + b"".join(b"%08X" % number for number in numbers)
        self._write_padded(header + path)
        self._write_padded(data)

    def add_tar(self, archive: tarfile.TarFile, leave_out: tuple[str, ...] = ()) -> None:
        """Add a tar archive's members, and end the archive; a hard link becomes a copy.

        leave_out: folders whose contents are left out (they themselves stay).
        """
        for member in archive:
            name = str(PurePosixPath(member.name))
            if name == "." or name.startswith(tuple(f"{folder}/" for folder in leave_out)):
                continue
            if member.islnk():
                target = archive.getmember(member.linkname)
                self.add(name, stat.S_IFREG | target.mode, _contents(archive, target))
            elif member.issym():
                self.add(name, stat.S_IFLNK | 0o777, member.linkname.encode())
            elif member.type in _TYPES:
                data = _contents(archive, member) if member.isreg() else b""
                device = (member.devmajor, member.devminor)
                self.add(name, _TYPES[member.type] | member.mode, data, device)
        self.finish()

    def add_parents(self, name: str) -> None:
        """Add the folders above `name`: an archive's folders must come before what is in them."""
        for parent in reversed(PurePosixPath(name).parents[:-1]):
            self.add(str(parent), stat.S_IFDIR | 0o755)

    def add_folder(self, folder: Path, name: str, leave_out: tuple[str, ...] = ("__pycache__",)) -> None:
        """Add a folder with everything below it as `name`; parts named in leave_out are left out."""
        self.add(name, stat.S_IFDIR | 0o755)
        for path in sorted(folder.iterdir()):
            if path.name in leave_out:
                continue
            if path.is_dir():
                self.add_folder(path, f"{name}/{path.name}", leave_out)
            elif path.is_file():
                self.add_file(path, f"{name}/{path.name}")

    def add_file(self, path: Path, name: str) -> None:
        """Add one file as `name`, executable if it is."""
        mode = 0o755 if path.stat().st_mode & 0o100 else 0o644
        self.add(name, stat.S_IFREG | mode, path.read_bytes())

    def finish(self) -> None:
        """Write the trailer."""
        self.add("TRAILER!!!", 0)

    def _write_padded(self, data: bytes) -> None:
        self._file.write(data)
        self._file.write(b"\0" * (-len(data) % 4))


def _contents(archive: tarfile.TarFile, member: tarfile.TarInfo) -> bytes:
    file = archive.extractfile(member)
    return file.read() if file is not None else b""
