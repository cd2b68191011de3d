"""The report of a study on one page: its question, tables, endings of cases, figures, and facts of the machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from nlsolve.contracts.status import Status
from nlsolve.results.aggregates import shared_ways
from nlsolve.results.parameters import differing_parameters
from nlsolve.results.verdicts import AT_A_SOLUTION
from nlsolve.show.expectations import Finding

PRINTED_DOTS_PER_INCH = 200  # of the PNGs, see nlsolve.show.figures
SCREEN_DOTS_PER_INCH = 110
PNG_WIDTH = slice(16, 20)  # bytes of the header that hold the width


def write_report(
    folder: Path,
    question: str,
    tables: Mapping[str, str | pd.DataFrame],
    figures: Sequence[tuple[str, str]],
    runs: pd.DataFrame,
    environments: Mapping[str, Mapping[str, str]] | None = None,
    findings: Sequence[Finding] = (),
    excluded: Sequence[tuple[str, str]] = (),
    notes: Mapping[str, Sequence[str]] | None = None,
) -> Path:
    """Write folder/report.html and return its path.

    tables : name -> DataFrame, or its HTML, which is trusted; everything else is escaped.
    figures : (name, caption); figures/NAME.png in the folder is linked, and a missing one is said to be missing.
    notes : name -> sentences beneath the table of this name.
    environments : what rows were computed with, by its name in their column `environment`.
    findings : what the study expects to find, judged.
    excluded : (label, reason) of each case that the study leaves out.
    """
    failed = runs[[status not in AT_A_SOLUTION for status in runs["status"].map(Status.of)]]
    parameters = differing_parameters(runs)
    environment = Environment(
        loader=PackageLoader("nlsolve.show", ""), autoescape=True, undefined=StrictUndefined, keep_trailing_newline=True
    )
    page = environment.get_template("report.html").render(
        question=question,
        cases=len(runs),
        ways=shared_ways(runs),
        endings=[{"word": word, "count": count} for word, count in runs["status"].value_counts().items()],
        findings=findings,
        excluded=grouped_by_reason(excluded),
        tables={name: _table(table) for name, table in tables.items()},
        notes=notes or {},
        parameters=parameters,
        failures=[
            {
                "case": run["case"],
                "parameters": ["" if _missing(run[name]) else run[name] for name in parameters],
                "status": run["status"],
                "sentence": _sentence(run),
            }
            for _, run in failed.iterrows()
        ],
        figures=[_figure(folder, name, caption) for name, caption in figures],
        environments=environments or {},
        rows_in=runs["environment"].value_counts() if "environment" in runs else {},
        facts=machine_facts(),
    )
    folder.mkdir(parents=True, exist_ok=True)
    path, draft = folder / "report.html", folder / "report.html.part"
    draft.write_text(page, encoding="utf-8")
    draft.replace(path)
    return path


def grouped_by_reason(excluded: Sequence[tuple[str, str]]) -> dict[str, list[str]]:
    """Reason -> the cases that are left out because of it."""
    found: dict[str, list[str]] = {}
    for label, reason in excluded:
        found.setdefault(reason, []).append(label)
    return found


def machine_facts() -> dict[str, str]:
    """Versions of libraries and the number of processors, on which the numbers of a report depend."""
    versions = {name: _version(name) for name in ("nlsolve", "numpy", "scipy")}
    return {**versions, "Python": platform.python_version(), "processors": str(os.cpu_count() or "unknown")}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:  # run from a checkout that is not installed
        return "(not installed)"


def _table(table: str | pd.DataFrame) -> Markup:
    if isinstance(table, str):
        return Markup(table)
    return Markup(table.to_html(border=0, escape=True, na_rep="", float_format=lambda number: f"{number:.4g}"))


def _figure(folder: Path, name: str, caption: str) -> dict[str, Any]:
    path = folder / "figures" / f"{name}.png"
    if not path.is_file():
        return {"name": name, "caption": caption, "drawn": False, "width": 0}
    with path.open("rb") as png:
        pixels = int.from_bytes(png.read(24)[PNG_WIDTH], "big")
    width = round(pixels * SCREEN_DOTS_PER_INCH / PRINTED_DOTS_PER_INCH)
    return {"name": name, "caption": caption, "drawn": True, "width": width}


def _sentence(run: pd.Series) -> str:
    """The message of a case, or the sentence of its status where it left none."""
    message = run.get("message")
    return message if isinstance(message, str) and message else Status.of(run["status"]).sentence


def _missing(value: Any) -> bool:
    return value is None or (isinstance(value, float) and value != value)
