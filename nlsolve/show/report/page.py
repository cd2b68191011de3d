"""The report of a study on one page: question, verdicts, tables, figures, failures, doubts, cost, and facts of the
machine."""

from __future__ import annotations

import os
import platform
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from jinja2 import Environment, PackageLoader, StrictUndefined

from nlsolve.results.aggregates import shared_ways
from nlsolve.results.parameters import differing_parameters
from nlsolve.show.expectations import Finding
from nlsolve.show.provenance import Provenance, version_of
from nlsolve.show.report.sheets import audits, cost, cost_in_words, doubts, failures, sheet_of

SCREEN_DOTS_PER_INCH = 110
MEDIA = {"png": "image/png", "apng": "image/apng", "gif": "image/gif", "mp4": "video/mp4"}


@dataclass(frozen=True)
class Picture:
    """A figure on the page.

    png : the picture; None where it could not be drawn. inches : its width on paper.
    moving : the animation beside it and its format, one of `MEDIA`.
    files : its files, relative to the page.
    """

    name: str
    caption: str
    png: bytes | None = None
    inches: float = 0.0
    moving: tuple[bytes, str] | None = None
    files: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Width on the screen [dots]."""
        return round(self.inches * SCREEN_DOTS_PER_INCH)

    @property
    def still(self) -> str:
        """The picture as an address that holds it; empty where there is none."""
        return "" if self.png is None else _inline(self.png, "png")

    @property
    def film(self) -> str:
        """The animation as an address that holds it; empty where there is none."""
        return "" if self.moving is None else _inline(*self.moving)


def _inline(content: bytes, form: str) -> str:
    return f"data:{MEDIA[form]};base64,{b64encode(content).decode()}"


def write_report(
    folder: Path,
    question: str,
    tables: Mapping[str, pd.DataFrame],
    figures: Sequence[Picture],
    runs: pd.DataFrame,
    environments: Mapping[str, Mapping[str, str]] | None = None,
    findings: Sequence[Finding] = (),
    excluded: Sequence[tuple[str, str]] = (),
    notes: Mapping[str, Sequence[str]] | None = None,
    provenance: Provenance | None = None,
    remarks: Sequence[str] = (),
    by: Sequence[str] = (),
) -> Path:
    """Write folder/report.html and return its path. Whatever is given as text is escaped.

    tables : name -> DataFrame of numbers or words.
    notes : name -> sentences beneath the table of this name.
    environments : what rows were computed with, by its name in their column `environment`.
    findings : what the study expects to find, judged.
    excluded : (label, reason) of each case that the study leaves out.
    provenance : the study, and what runs it; None: not known.
    remarks : what is said of the results as a whole, such as how much of the study is finished.
    by : the parameters that tell cases apart; absent: those that differ.
    """
    names = [name for name in by if name in runs] or differing_parameters(runs)
    environment = Environment(
        loader=PackageLoader("nlsolve.show.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("page.html").render(
        question=question,
        cases=len(runs),
        ways=shared_ways(runs),
        remarks=remarks,
        endings=[{"word": word, "count": count} for word, count in runs["status"].value_counts().items()],
        findings=findings,
        excluded=grouped_by_reason(excluded),
        tables={name: sheet_of(table) for name, table in tables.items()},
        notes=notes or {},
        failures=failures(runs, names),
        doubts=doubts(runs, names),
        audits=audits(runs),
        cost=cost(runs, names),
        cost_in_words=cost_in_words(runs),
        figures=figures,
        environments=environments or {},
        rows_in=runs["environment"].value_counts() if "environment" in runs else {},
        facts=machine_facts(),
        provenance=provenance,
        folder=folder.name,
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
    versions = {name: version_of(name) for name in ("nlsolve", "numpy", "scipy")}
    return {**versions, "Python": platform.python_version(), "processors": str(os.cpu_count() or "unknown")}
