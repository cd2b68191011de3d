"""The studies that ship with nlsolve: what each asks, and copies of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.running.packing.study_files import StudyFiles
from nlsolve.study.documents import read_document

PACKAGE = Path(__file__).parents[2]

PLACES = (PACKAGE / "studies", PACKAGE.parent / "studies")
"""Where the studies are: in an installed package, and in a checkout."""

ALL = "all"
"""Stands for the names of all studies."""


@dataclass(frozen=True)
class Shipped:
    """A study that ships: its name, such as first or paper/table-1, its file, and what it asks.

    has_quick : whether it has a shrunk form.
    """

    name: str
    file: Path
    question: str
    has_quick: bool


def shipped_studies() -> list[Shipped]:
    """All studies that ship, those of folders last. Raises StudyError where they are missing."""
    place = next((place for place in PLACES if place.is_dir()), None)
    if place is None:
        raise StudyError(f"the shipped studies are missing, which belong in {PLACES[0]}: install nlsolve again")
    files = sorted(place.rglob("*.toml"), key=lambda file: (len(file.relative_to(place).parts), file))
    return [_read(file.relative_to(place).with_suffix("").as_posix(), file) for file in files]


def copied(name: str) -> Mapping[str, str]:
    """Path -> text of a shipped study and of all that it names; of all studies, in their folders, for the name "all".

    Raises StudyError when no study has this name.
    """
    studies = shipped_studies()
    if name == ALL:
        return {f"{study.name}.toml": study.file.read_text(encoding="utf-8") for study in studies}
    chosen = next((study for study in studies if study.name == name.removesuffix(".toml")), None)
    if chosen is None:
        known = [*(study.name for study in studies), ALL]
        raise StudyError(f"{name}: no study of this name ships; {did_you_mean(name, known)}")
    files = StudyFiles(chosen.file, chosen.file.name)
    return files.texts | {path: file.read_text(encoding="utf-8") for path, file in files.plugins.items()}


def _read(name: str, file: Path) -> Shipped:
    document, _ = read_document(file)
    return Shipped(name, file, str(document.get("question", "")), "quick" in document)
