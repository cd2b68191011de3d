"""The ways that a results folder keeps, so that a study that is resumed or grows need not solve them again.

ways/NAME.npz    the states of a way, and as JSON how its solves ended
ways/claims/     locks of the runs that solve one now
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from nlsolve.contracts.outcome import Outcome
from nlsolve.contracts.status import Status
from nlsolve.running.store.parts import WAYS, replacing
from nlsolve.series import Array
from nlsolve.solving.way import Stretch, Way

SUFFIX = ".npz"


def way_path(folder: Path, name: str) -> Path:
    """Where a way is kept."""
    return folder / WAYS / f"{name}{SUFFIX}"


def read_way(folder: Path, name: str) -> Way | None:
    """A way of a results folder; None when it is not there, or damaged."""
    try:
        with way_path(folder, name).open("rb") as file, np.load(file, allow_pickle=False) as held:
            plain = json.loads(str(held["stretches"]))
            return Way(tuple(_stretch(each, held[f"state{number}"]) for number, each in enumerate(plain)))
    except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile):
        return None


def write_way(folder: Path, name: str, way: Way) -> None:
    """Keep a way, whole or not at all."""
    states = {f"state{number}": stretch.outcome.state for number, stretch in enumerate(way.stretches)}
    told = json.dumps([_plain(stretch) for stretch in way.stretches])
    with replacing(folder, way_path(folder, name)) as temporary, temporary.open("wb") as file:
        np.savez(file, stretches=np.array(told), **states)  # type: ignore[arg-type]


def _plain(stretch: Stretch) -> dict[str, Any]:
    """A stretch without its state, as JSON values."""
    outcome = {name: value for name, value in asdict(stretch.outcome).items() if name not in ("state", "rows")}
    told = {**outcome, "status": stretch.outcome.status.word, "steps": len(stretch.outcome.rows)}
    return {**asdict(stretch), "outcome": told}


def _stretch(plain: dict[str, Any], state: Array) -> Stretch:
    told = plain.pop("outcome")
    steps: tuple[dict[str, Any], ...] = ({},) * told.pop("steps")
    outcome = Outcome(**{**told, "status": Status.of(told["status"]), "state": state, "rows": steps})
    return Stretch(**plain, outcome=outcome)
