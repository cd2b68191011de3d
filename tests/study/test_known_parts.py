"""What is known of the component of a section."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel

from nlsolve.plugin import InputFile
from nlsolve.study.known_parts import classes_of, files_read


class Reader(BaseModel):
    """Fields that name files, and one that does not."""

    kind: Literal["reader"] = "reader"
    nodes: InputFile = "nodes.csv"
    mesh: Path = Path("a.msh")
    word: str = "nodes.csv"


class Library(BaseModel):
    """Readers inside a component, one of a file that another reads too."""

    readers: list[Reader] = [Reader(), Reader(nodes="b.csv")]


def test_files_are_the_fields_that_say_so():
    assert files_read(Reader()) == ("nodes.csv", "a.msh")


def test_files_and_classes_of_components_inside_components_count():
    assert files_read({"scene": Library(), "law": None}) == ("nodes.csv", "a.msh", "b.csv")
    assert classes_of({"scene": Library(), "law": None}) == {Library, Reader}
