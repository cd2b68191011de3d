"""Where a row was computed: versions, processor, BLAS and its threads, and the commit of a checkout of nlsolve.

It does not tell cases apart; it is stored once for all rows that share it, under a short digest.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from pathlib import Path

from threadpoolctl import threadpool_info

from nlsolve.registry.installed.hookspecs import PROJECT
from nlsolve.running.store.sources import LETTERS, fingerprint, numerics

LIBRARIES = (PROJECT, "numpy", "scipy", "pandas", "pydantic")


@cache
def environment_here() -> Mapping[str, str]:
    """The environment of this process, looked up once, where cases run: within the limit of their threads."""
    plugins = {entry.dist.name for entry in entry_points(group=PROJECT) if entry.dist is not None}
    blas = {
        f"{pool['internal_api']} {pool.get('version') or ''} {pool.get('architecture') or ''}".strip(): pool
        for pool in threadpool_info()
    }
    return {
        **{name: _version(name) for name in (*LIBRARIES, *sorted(plugins - set(LIBRARIES)))},
        "numerics": numerics(),
        "commit": _commit(Path(__file__).parents[3]),
        "Python": platform.python_version(),
        "system": platform.platform(),
        "processor": _processor(),
        "processors": str(os.cpu_count() or "unknown"),
        "BLAS": ", ".join(sorted(blas)) or "unknown",
        "threads": ", ".join(f"{blas[name]['num_threads']}" for name in sorted(blas)) or "unknown",
    }


def name_of(environment: Mapping[str, str]) -> str:
    """The short digest under which an environment is stored; empty for none."""
    return fingerprint(json.dumps(dict(environment), sort_keys=True).encode())[:8] if environment else ""


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "(not installed)"


def _commit(folder: Path) -> str:
    """The commit of a checkout, read without a process, whose work would count as the case's; "none" for a package."""
    git = folder / ".git"
    if not git.exists():
        return "none"
    try:
        if git.is_file():  # a worktree
            git = folder / git.read_text(encoding="utf-8").partition(":")[2].strip()
        _, is_branch, name = (git / "HEAD").read_text(encoding="utf-8").strip().rpartition("ref: ")
        if not is_branch:
            return name[:LETTERS]
        shared = git / "commondir"
        home = git / shared.read_text(encoding="utf-8").strip() if shared.is_file() else git
        if (home / name).is_file():
            return (home / name).read_text(encoding="utf-8")[:LETTERS]
        packed = (home / "packed-refs").read_text(encoding="utf-8").splitlines()
        return next((line[:LETTERS] for line in packed if line.endswith(f" {name}")), "unknown")
    except OSError:
        return "unknown"


def _processor() -> str:
    """The model of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:  # not Linux
        return platform.processor() or platform.machine()
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.machine())
