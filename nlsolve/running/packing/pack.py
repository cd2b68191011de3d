"""A study, the files it needs, versions and its results in one zip that somebody else can run again."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

from nlsolve.running.packing.study_files import StudyFiles
from nlsolve.running.store.claims import CLAIMS
from nlsolve.running.store.identity import identity_of
from nlsolve.running.store.parts import CASES, ENVIRONMENTS, WAYS, Entry, Parts, StoreError, replacing, writing
from nlsolve.study.study import Study

HOW_TO_RERUN = """{question}

study.toml     the study; plugins of one file and studies that it extends are beside it
results/       its results: report.html shows them, cases/ has every case with the source and the files it depends on
versions.txt   versions of nlsolve, of installed plugins and of libraries where the cases were computed

To run it again, install nlsolve and the plugins in these versions, and in this folder

    nlsolve plan study.toml --out results{options}
    nlsolve run study.toml --out results{options}

The plan says which cases would be computed again, and why. With another folder behind --out all of them are.
"""


def export(
    study: Study, path: Path, options: Sequence[str], folder: Path, to: Path, plugins: Iterable[Path] = ()
) -> list[Path]:
    """Pack a study, the files it needs, versions and its results into a zip that somebody else can run again.

    path : the study file; options : with which options it was run; plugins : files that were given with it.
    Returns the files that it reads but that are not in the zip, because their names lead out of the working folder.
    Raises StoreError when nothing of the study is finished, or the zip cannot be written.
    """
    identities = [identity_of(case) for case in study.cases]
    parts = Parts(folder)
    entries = {key: entry for key in (each.key for each in identities) if (entry := parts.entry(key)) is not None}
    if not entries:
        raise StoreError(f"{folder}: nothing of this study is finished there: run it first")
    read = sorted({Path(name) for identity in identities for name in identity.files})
    packed = [file for file in read if file.is_file() and not file.is_absolute() and ".." not in file.parts]
    names = {str(entry.measured.get("environment")) for entry in entries.values()}
    environments = {name: parts.environment(name) for name in sorted(names)}
    files = StudyFiles(path, "study.toml")
    words = [*options, *(word for plugin in plugins for word in ("--plugin", files.add_plugin(plugin)))]
    told = HOW_TO_RERUN.format(question=study.question, options=f" {shlex.join(words)}" if words else "")
    with writing(to.parent), replacing(to.parent, to) as temporary, ZipFile(temporary, "w", ZIP_DEFLATED) as pack:
        pack.writestr("README.txt", told)
        for name, text in files.texts.items():
            pack.writestr(name, text)
        for name, plugin in files.plugins.items():
            pack.write(plugin, name)
        pack.writestr("versions.txt", _versions(environments))
        for file in packed:
            pack.write(file, file.as_posix())
        for file in _results_of(folder, entries, environments):
            pack.write(file, f"results/{file.relative_to(folder).as_posix()}")
    return [*files.missing, *(file for file in read if file not in packed)]


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
