"""Results folders put together and tidied up."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from nlsolve.contracts.status import STOPPED
from nlsolve.results.verdicts import status_of
from nlsolve.running.retry import TRIED_AGAIN
from nlsolve.running.store.claims import CLAIMS, LOCK, claimed
from nlsolve.running.store.identity import case_of
from nlsolve.running.store.parts import (
    CASES,
    ENVIRONMENTS,
    PARTIAL,
    WAYS,
    Entry,
    Parts,
    StoreError,
    replacing,
    writing,
)
from nlsolve.running.store.reading import STUDY, description_of, is_results_folder


@dataclass(frozen=True)
class Merged:
    """What became of the parts of a folder that was merged into another."""

    copied: int
    there: int
    damaged: int


def merge_folders(source: Path, into: Path) -> Merged:
    """Copy the finished cases of a results folder into another, which need not exist.

    A case that both have stays as it is, unless it failed there and not here. Raises StoreError for a source that is no
    results folder.
    """
    if not is_results_folder(source):
        raise StoreError(f"{source}: not a results folder: it has no folder {CASES!r}")
    given, kept = Parts(source), Parts(into)
    for parts in (given, kept):
        parts.refuse_old()
    with writing(into):
        (into / CASES).mkdir(parents=True, exist_ok=True)
    copied = there = damaged = 0
    for key in given.names():
        entry, other = given.entry(key), kept.entry(key)
        if entry is None:
            damaged += 1
        elif other is not None and not (_failed(other) and not _failed(entry)):
            there += 1
        else:
            _copy(source, into, key, entry)
            copied += 1
    if not (into / STUDY).exists() and (source / STUDY).exists():
        _copy_file(into, source / STUDY, into / STUDY)
    return Merged(copied, there, damaged)


def _failed(entry: Entry) -> bool:
    return status_of(entry.measured) in {*TRIED_AGAIN, *STOPPED}


def _copy(source: Path, into: Path, key: str, entry: Entry) -> None:
    """Copy one part, its JSON last."""
    environment = Path(ENVIRONMENTS) / f"{entry.measured.get('environment')}.json"
    names = [Path(CASES) / f"{key}.{name}.parquet" for name in entry.frames]
    for name in (environment, *names, Path(CASES) / f"{key}.txt", Path(CASES) / f"{key}.json"):
        if (source / name).is_file():
            _copy_file(into, source / name, into / name)


def _copy_file(folder: Path, source: Path, target: Path) -> None:
    with replacing(folder, target) as temporary:
        shutil.copyfile(source, temporary)


def superfluous(folder: Path, others: bool = False) -> list[Path]:
    """The files of a results folder that nothing needs; with `others`, those of other studies' cases as well.

    They are parts that are damaged, or that a later part of the same case has taken the place of; frames without a
    part; environments and ways without a row; and what killed runs have left, unless a run is at work now.
    Raises StoreError when this is no results folder, or `others` is asked for and its study cannot be read.
    """
    if not is_results_folder(folder):
        raise StoreError(f"{folder}: not a results folder: it has no folder {CASES!r}")
    parts, described = Parts(folder), description_of(folder)
    if others and described is None:
        raise StoreError(
            f"{folder}: its {STUDY} cannot be read, which tells the study's own cases: run the study again"
        )
    planned = {case.key for case in described.cases} if described is not None else set()
    entries = {key: entry for key in parts.names() if (entry := parts.entry(key)) is not None}
    last: dict[str, str] = {}
    for key in sorted(entries, key=lambda key: entries[key].written):
        last[case_of(key)] = key
    needed = {key for key in entries if key in planned or (not others and last[case_of(key)] == key)}
    running = set(claimed(folder))
    used = {f"{entries[key].measured.get('environment')}.json" for key in needed}
    ways = {entries[key].measured.get("start_way") for key in needed}
    found = [path for path in (folder / CASES).iterdir() if path.name.split(".")[0] not in needed | running]
    if not running:
        found += folder.rglob(f".*{PARTIAL}")
        for locks in (folder / CLAIMS, folder / WAYS / CLAIMS):
            found += locks.glob(f"*{LOCK}")
        found += (path for path in (folder / WAYS).glob("*.npz") if path.stem not in ways)
        found += (path for path in (folder / ENVIRONMENTS).glob("*.json") if path.name not in used)
    return sorted({path for path in found if path.is_file() and (not running or not path.name.startswith("."))})


def remove(folder: Path, files: Iterable[Path]) -> int:
    """Remove files of a results folder; returns how many bytes they had. A part goes before its frames."""
    freed = 0
    with writing(folder):
        for path in sorted(files, key=lambda path: path.suffix != ".json"):
            freed += path.stat().st_size
            path.unlink()
    return freed
