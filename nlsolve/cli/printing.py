"""What the commands print: data on standard output as tables or JSON, sentences on standard error."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table as RichTable

from nlsolve.contracts.status import Status
from nlsolve.flow.validity import LIMITS
from nlsolve.results.frames import json_rows, rows_of
from nlsolve.results.verdicts import doubt, number, status_of
from nlsolve.running.results import Results
from nlsolve.running.retry import is_final
from nlsolve.running.store.reading import output_file
from nlsolve.show.staleness import Included
from nlsolve.show.tables import Table
from nlsolve.study.study import Study

MOST_RULED_ROWS, MOST_RULED_COLUMNS, MOST_RULED_CELLS = 500, 40, 5000
"""Size up to which a table is printed with rules: ruling a hundred thousand cells takes half a minute, and of a hundred
columns one letter each is left."""

UNFOLDED = 400
"""Characters a line may have in a file or a pipe."""


WIDEST = 110
"""Letters of a line of text."""


def say(sentence: str) -> None:
    """Print a line on standard error."""
    typer.echo(sentence, err=True)


def count(cases: int) -> str:
    """1 case, 2 cases"""
    return f"{cases} case{'' if cases == 1 else 's'}"


def say_excluded(study: Study) -> None:
    """Say how many cases a study leaves out, and why."""
    reasons = Counter(excluded.reason for excluded in study.excluded)
    for reason, cases in reasons.items():
        say(f"left out: {count(cases)}: {reason}")


def stdout() -> Console:
    """Standard output; tables are not folded when it is a file or a pipe."""
    console = Console(emoji=False)  # a qualified kind between colons is no emoji
    return console if console.is_terminal else Console(width=UNFOLDED, emoji=False)


def folded(start: str, text: str) -> list[str]:
    """A text as lines: the first after `start`, the others below its first letter."""
    width = max(40, min(shutil.get_terminal_size((WIDEST, 1)).columns, WIDEST))
    return textwrap.wrap(
        text,
        width,
        initial_indent=start,
        subsequent_indent=" " * len(start),
        break_on_hyphens=False,
        break_long_words=False,
    )


def print_frame(title: str, frame: pd.DataFrame) -> None:
    """Print a frame on standard output: as a table, or, of many cells, as lines with aligned columns."""
    headings = [str(heading) for heading in frame.columns]
    rows = [
        [f"{value:.4g}" if isinstance(value, float) else str(value) for value in row]
        for row in frame.itertuples(index=False)
    ]
    if _is_large(frame):
        widths = [max(map(len, column)) for column in zip(headings, *rows, strict=True)]
        lines = ("  ".join(map(str.ljust, row, widths)).rstrip() for row in [headings, *rows])
        typer.echo("\n".join([title, *lines]))
        return
    printed = RichTable(title=escape(title))
    for heading in headings:
        printed.add_column(escape(heading), overflow="fold")
    for row in rows:
        printed.add_row(*map(escape, row))
    stdout().print(printed)


def print_table(table: Table) -> None:
    """Print a declared table, and what it is compared with, on standard output."""
    if _is_large(table.cells):
        for title, frame in table.flat().items():
            print_frame(title, frame)
        for note in table.notes:
            typer.echo(note)
        return
    for printed in table.rich():
        stdout().print(printed)


def print_included(included: Sequence[Included], folder: Path, as_json: bool) -> None:
    """Print of what a paper includes whether it says what the results in a folder say."""
    if as_json:
        rows = [{"file": str(each.file), each.noun: each.name, "reason": each.reason} for each in included]
        typer.echo(json.dumps(rows))
    for each in () if as_json else included:
        fresh = {
            "table": f"; a fresh one is {folder / 'tables' / each.name}.tex after nlsolve run",
            "figure": f"; nlsolve figure {folder} {each.name} draws it again",
        }
        way_out = fresh[each.noun] if each.reason else ""
        typer.echo(f"{each.file}: {each.noun} {each.name}: {each.reason or 'as the results say'}{way_out}")


def _is_large(frame: pd.DataFrame) -> bool:
    rows, columns = frame.shape
    return rows > MOST_RULED_ROWS or columns > MOST_RULED_COLUMNS or frame.size > MOST_RULED_CELLS


def print_results(results: Results, as_json: bool) -> None:
    """Print the declared tables, or the endings of all cases when no table is declared; as JSON all of it."""
    tables = results.tables()
    if as_json:
        shown = {table.spec.name: table.long() for table in tables}
        document = {"study": results.study.name, "folder": str(results.folder), "runs": json_rows(results.runs)}
        findings = [asdict(finding) for finding in results.findings]
        typer.echo(json.dumps(document | {"tables": shown, "notes": list(results.notes), "findings": findings}))
        return
    for declared in tables:
        print_table(declared)
    if not tables:
        swept = list(dict.fromkeys(name for case in results.study.cases for name in case.swept))
        print_endings(results.study.question, results.runs, swept)


def print_endings(question: str, runs: pd.DataFrame, by: list[str]) -> None:
    """Print how each case ended, with its parameters `by`, on standard output."""
    print_frame(question, runs.reindex(columns=["case", *by, "status", "message"]))


def say_endings(results: Results) -> None:
    """Say how many cases ended how, with the message of one case of each ending that is no convergence, and one of
    the doubts that no audit explains."""
    runs, rows = results.runs, rows_of(results.runs)
    numbers = {str(word): int(cases) for word, cases in runs["status"].value_counts().items()}
    endings = ", ".join(f"{cases} {word}" for word, cases in numbers.items())
    say(f"{count(len(runs))}: {endings or 'none has ended'}; results in {results.folder}")
    firsts = {status_of(run): run for run in rows_of(runs.drop_duplicates("status"))}
    firsts.pop(Status.CONVERGED, None)
    crash = firsts.pop(Status.CRASHED, None)
    for status, run in firsts.items():
        more = _more(numbers[status.word])
        say(f"case {run['case']}{more} ended as {status.word}: {run['message']}{_printed(results, run)}")
    if crash is not None:
        more = _more(numbers[Status.CRASHED.word])
        say(f"case {crash['case']}{more} crashed: {crash['message']}{_printed(results, crash)}")
    doubted = [run for run in rows if doubt(run) and not _is_audited(run)]
    if doubted:
        say(f"case {doubted[0]['case']}{_more(len(doubted))} is in doubt: {doubt(doubted[0])}")
    kept = sorted({run["status"] for run in rows if is_final(run)})
    if kept:
        options = " ".join(f"--retry {word!r}" for word in kept)
        say(f"what was stopped at a limit is run again when the limit is raised, and all of these with {options}")


def _is_audited(run: Mapping[str, Any]) -> bool:
    """Whether an audit explains the doubt, which `left_out` tells."""
    return any(limit.doubt and number(run.get(name)) > limit.largest for name, limit in LIMITS.items())


def _more(cases: int) -> str:
    """What is said of the other cases that ended as the one that is told."""
    return f" (one of {cases})" if cases > 1 else ""


def _printed(results: Results, run: Mapping[str, Any]) -> str:
    """Where a case's output is; empty when it has printed nothing."""
    file = None if results.folder is None else output_file(results.folder, run["case"])
    return "" if file is None else f"; what it printed is in {file}"


def left_out(runs: pd.DataFrame) -> list[str]:
    """Lines with the worst value of each audit over the cases and what to do about it; none when no audit was made.
    What law, scene and numbers claim is told only where it does not hold.
    """
    lines = []
    for name, limit in LIMITS.items():
        values = pd.to_numeric(runs[name]).dropna()
        over = int((values > limit.largest).sum())
        advice = f"  in {count(over)}: {limit.sentence}" if over else ""
        if over or (limit.always and len(values)):
            lines.append(f"  {name.removeprefix('audit.').replace('_', ' '):<23} {values.max():<8.2g}{advice}".rstrip())
    return ["What the scenes left out, at its largest:", *lines] if lines else []
