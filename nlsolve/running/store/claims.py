"""Which cases of a folder are being computed, by this run or another: each has a lock that dies with its owner.

A claim is a file in `claims/` on which its owner holds `flock`. The system frees the lock when the owner ends, however
it ends, so that no case is lost to a run that was killed. On a file system without locks, and on Windows, every claim
is granted: two runs then compute the same cases, each writing whole parts.
"""

from __future__ import annotations

import os
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

CLAIMS = "claims"
"""Name of the folder of locks."""

LOCK = ".lock"


class Claims:
    """The claims of one run on the cases of a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / CLAIMS
        self._held: dict[str, int] = {}

    def take(self, key: str) -> bool:
        """Claim a case; False while another run has it."""
        if fcntl is None or key in self._held:
            return True
        path = self.folder / f"{key}{LOCK}"
        self.folder.mkdir(parents=True, exist_ok=True)
        while True:
            file = os.open(path, os.O_CREAT | os.O_RDWR)
            if not _locked(file, fcntl.LOCK_EX):
                os.close(file)
                return False
            if _is(file, path):
                self._held[key] = file
                return True
            os.close(file)  # its owner has just released it, and with it this file

    def release(self, key: str) -> None:
        """Give up a claim, if this run has it."""
        file = self._held.pop(key, None)
        if file is not None:
            (self.folder / f"{key}{LOCK}").unlink(missing_ok=True)
            os.close(file)

    def release_all(self) -> None:
        """Give up all claims of this run."""
        for key in list(self._held):
            self.release(key)


def claimed(folder: Path) -> list[str]:
    """The names of the parts that runs are computing now."""
    paths = (folder / CLAIMS).glob(f"*{LOCK}") if fcntl is not None else ()
    return sorted(path.name.removesuffix(LOCK) for path in paths if _is_held(path))


def _is_held(path: Path) -> bool:
    try:
        file = os.open(path, os.O_RDONLY)
    except OSError:  # released since
        return False
    try:
        return not _locked(file, fcntl.LOCK_SH)
    finally:
        os.close(file)


def _locked(file: int, kind: int) -> bool:
    """Lock an open file at once; False where another has it."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _is(file: int, path: Path) -> bool:
    """Whether an open file is still the one at `path`."""
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except OSError:
        return False
