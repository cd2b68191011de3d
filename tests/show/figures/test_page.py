"""docs/figures.md tells the truth: its studies are valid, its data are those written, it has every key and kind."""

from __future__ import annotations

import re
import tomllib
from io import StringIO
from pathlib import Path
from typing import Any, get_args

import pandas as pd
import pytest
from pydantic import TypeAdapter

import nlsolve
from nlsolve.show.figures import BaseFigure, FigureSpec, Look, drawn
from nlsolve.study.study import Study

PAGE = Path(__file__).parents[3] / "docs" / "figures.md"


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


def declared(page: str) -> list[dict[str, Any]]:
    return [tomllib.loads(text) for text in re.findall(r"```toml\n(.*?)```", page, re.DOTALL)]


def test_the_data_shown_are_those_that_are_written(page: str) -> None:
    (shown,) = re.findall(r"```text\n(curve,.*?)```", page, re.DOTALL)
    results = nlsolve.run(declared(page)[0], isolation="none")
    (spec,) = results.study.figures
    _, data = drawn(spec, results.frames)
    printed = pd.read_csv(StringIO(shown))
    pd.testing.assert_frame_equal(data.head(len(printed)), printed, check_dtype=False, rtol=1e-9)
    assert (spec.width, spec.formats) == ("84 mm", ("pdf", "pgf"))


def test_the_strip_is_one_that_a_study_may_declare(page: str) -> None:
    _, strip = declared(page)
    base = tomllib.loads((PAGE.parents[1] / "studies" / "mixing.toml").read_text(encoding="utf-8"))
    (spec,) = Study.from_dict({**base, **strip}).figures
    assert set(spec.times) <= set(strip["record"]["times"])
    assert spec.animation == "gif"


def test_every_key_of_a_look_and_every_kind_is_there(page: str) -> None:
    keys = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert set(Look.model_fields) <= set(keys)
    kinds = {kind.model_fields["kind"].default for kind in get_args(get_args(FigureSpec)[0])}
    (table,) = re.findall(r"## The data of each kind\n\n(.*?)\n\n", page, re.DOTALL)
    assert kinds == {kind for row in table.splitlines()[2:] for kind in re.findall(r"`([\w-]+)`", row.split("|")[1])}
    assert isinstance(TypeAdapter(FigureSpec).validate_python({"kind": "cloud", "name": "n"}), BaseFigure)
