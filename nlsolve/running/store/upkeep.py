"""Results folders put together, tidied up, and packed for somebody else."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

from nlsolve.contracts.status import STOPPED
from nlsolve.results.verdicts import status_of
from nlsolve.running.retry import TRIED_AGAIN
from nlsolve.running.store.claims import CLAIMS, LOCK, claimed
from nlsolve.running.store.identity import case_of, identity_of
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
from nlsolve.study.study import Study

HOW_TO_RERUN = """{question}

study.toml     the study
results/       its results: report.html shows them, cases/ has every case with the source and the files it depends on
versions.txt   versions of nlsolve, of its plugins and of libraries where the cases were computed

To run it again, install nlsolve and the plugins in these versions, and in this folder

    nlsolve plan study.toml --out results{options}
    nlsolve run study.toml --out results{options}

The plan says which cases would be computed again, and why. With another folder behind --out all of them are.
"""


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


def export(study: Study, text: str, options: str, folder: Path, to: Path) -> list[Path]:
    """Pack a study, the files it reads, versions and its results into a zip that somebody else can run again.

    text : the study file; options : with which options it was run.
    Returns the files that it reads but that are not in the zip, because their names lead out of the working folder.
    Raises StoreError when nothing of the study is finished, or the zip cannot be written.
    """
    identities = [identity_of(case) for case in study.cases]
    parts = Parts(folder)
    entries = {key: entry for key in (each.key for each in identities) if (entry := parts.entry(key)) is not None}
    if not entries:
        raise StoreError(f"{folder}: nothing of this study is finished there: run it first")
    read = sorted({Path(name) for identity in identities for name in identity.files})
    packed = [path for path in read if path.is_file() and not path.is_absolute() and ".." not in path.parts]
    names = {str(entry.measured.get("environment")) for entry in entries.values()}
    environments = {name: parts.environment(name) for name in sorted(names)}
    told = HOW_TO_RERUN.format(question=study.question, options=f" {options}" if options else "")
    with writing(to.parent), replacing(to.parent, to) as temporary, ZipFile(temporary, "w", ZIP_DEFLATED) as pack:
        pack.writestr("README.txt", told)
        pack.writestr("study.toml", text)
        pack.writestr("versions.txt", _versions(environments))
        for path in packed:
            pack.write(path, path.as_posix())
        for path in _results_of(folder, entries, environments):
            pack.write(path, f"results/{path.relative_to(folder).as_posix()}")
    return [path for path in read if path not in packed]


def _results_of(folder: Path, entries: Mapping[str, Entry], environments: Iterable[str]) -> list[Path]:
    """The files of a results folder that belong to these parts, and what is shown of the study."""
    shown = [
        path
        for path in folder.rglob("*")
        if path.relative_to(folder).parts[0] not in (CASES, ENVIRONMENTS, WAYS, CLAIMS)
    ]
    kept = [folder / CASES / f"{key}{suffix}" for key in entries for suffix in (".json", ".txt")]
    kept += [folder / CASES / f"{key}.{name}.parquet" for key, entry in entries.items() for name in entry.frames]
    kept += [folder / ENVIRONMENTS / f"{name}.json" for name in environments]
    return sorted(path for path in (*shown, *kept) if path.is_file() and not path.name.startswith("."))


def _versions(environments: Mapping[str, Mapping[str, str]]) -> str:
    lines = []
    for name, environment in environments.items():
        lines += [f"# environment {name}", *(f"{fact}: {value}" for fact, value in environment.items()), ""]
    return "\n".join(lines)
