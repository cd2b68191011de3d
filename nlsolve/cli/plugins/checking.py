"""What a kind or a file means to `nlsolve check`, and what is found of it; in a process that a plugin may end."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from nlsolve.contracts.component import Component
from nlsolve.contracts.status import InputError
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.plugin_files import with_files
from nlsolve.registry.problems import StudyError, did_you_mean
from nlsolve.registry.registry import Registry, load_registry
from nlsolve.study.sweeps import parse_assignments
from nlsolve.testing.kit.subjects import contract_of, verdicts_of
from nlsolve.testing.kit.verdicts import WHOLE, Verdict

PAGE = "docs/plugins.md"
"""Where the promises of every contract are explained."""

REGISTERED = "registered"
"""The name of the promise that a file can be imported and its classes registered."""


MADE = "made"
"""The name of the promise that a component can be made of its fields."""

FILE = "file"
"""Stands for the noun of a file, which is no component."""


@dataclass(frozen=True)
class Checked:
    """A component that was checked: its noun and kind, where to read on, and what was found."""

    noun: str
    kind: str
    see: str
    verdicts: tuple[Verdict, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every promise holds."""
        return all(verdict.holds for verdict in self.verdicts)

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> Checked:
        """What `dataclasses.asdict` has made a table."""
        return cls(**{**table, "verdicts": tuple(Verdict(**each) for each in table["verdicts"])})


Begun = Callable[[Checked, str], None]
"""Is told what has been found of a component so far, and the promise that is checked next."""


def checked(
    subject: str, registry: Registry, settings: Sequence[str], skip: int = 0, begun: Begun = lambda so_far, name: None
) -> Iterator[Checked]:
    """The components of a file, or of a kind of whatever contract, but the first ones.

    settings : FIELD=VALUE, for the components that have the field. skip : how many components are left out.
    Raises StudyError where there is no such file or kind, and for settings that do not fit.
    """
    fields, path, wider = parse_assignments(list(settings)), Path(subject), registry
    if path.suffix == ".py" or path.is_file():
        if not path.is_file():
            raise StudyError(f"the plugin {path} cannot be read: there is no such file")
        promised = Verdict(REGISTERED, "the file can be imported, and its classes registered")
        file = Checked(FILE, path.name, f"{PAGE}#one-file-is-a-plugin", (promised,))
        begun(file, REGISTERED)
        try:
            wider = with_files(registry, [path])
        except StudyError as error:
            yield broken(file, REGISTERED, str(error))
            return
        known = {cls for noun in CONTRACTS for cls in registry.offered(noun, absent_too=True).values()}
        offered = [each for noun in CONTRACTS for each in wider.offered(noun, absent_too=True).items()]
        classes = [(kind, cls) for kind, cls in offered if cls not in known]
    else:
        classes = [(subject, cls) for noun in CONTRACTS if (cls := registry.class_called(noun, subject)) is not None]
    if not classes:
        kinds = sorted({kind for noun in CONTRACTS for kind in registry.classes(noun)})
        raise StudyError(f"{subject}: no plugin offers this kind; {did_you_mean(subject, kinds)}")
    strange = [name for name in fields if not any(name in cls.model_fields for _, cls in classes)]
    if strange:
        raise StudyError(f"--set {strange[0]}: {subject} has no such field")
    with wider.in_use():
        for kind, cls in classes[skip:]:
            yield _one(kind, cls, {name: value for name, value in fields.items() if name in cls.model_fields}, begun)


def broken(found: Checked, name: str, failure: str) -> Checked:
    """What was found, and besides that the promise of this name is broken."""
    kept = (each for each in found.verdicts if each.name == name or each.name != WHOLE)
    told = (replace(each, failure=failure, reached=True) if each.name == name else each for each in kept)
    return replace(found, verdicts=tuple(told))


def _one(kind: str, cls: type[Component], fields: Mapping[str, Any], begun: Begun) -> Checked:
    """What is found of a component with these fields, and defaults.

    Raises StudyError where a field is missing or wrong.
    """
    promised = Verdict(MADE, "a component of this kind can be made")
    first = Checked(cls.noun, kind, f"{PAGE}#{contract_of(cls).__name__.lower()}", (promised,))
    begun(first, MADE)
    try:
        component = cls(**fields)
    except ValidationError as error:
        said = error.errors()[0]
        name = ".".join(map(str, said["loc"]))
        raise StudyError(f"{kind}: {name}: {said['msg']}: give it by --set {name}=VALUE") from error
    except Exception as error:  # a stranger's class may raise anything
        return broken(first, MADE, f"raised {type(error).__name__}: {error}")
    return replace(
        first, verdicts=verdicts_of(component, lambda name, found: begun(replace(first, verdicts=found), name))
    )


def tell(descriptor: int, subject: str, files: Sequence[str], settings: Sequence[str], skip: int) -> None:
    """What the process of `apart.py` runs: it sends what `checked` finds, and what it is at, as JSON.

    files : plugins of one file that are there besides.
    """
    connection = Connection(descriptor, readable=False)

    def send(**message: Any) -> None:
        connection.send_bytes(json.dumps(message).encode())

    try:
        registry = with_files(load_registry(), map(Path, files))
        for found in checked(subject, registry, settings, skip, lambda at, name: send(at=asdict(at), name=name)):
            send(checked=asdict(found))
    except InputError as error:
        send(wrong=str(error))
    else:
        send(end=True)
