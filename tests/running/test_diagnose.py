"""How good the operators of a study's clouds are: rows, JSON, what is shown once, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fakes import registry_of, write_study
from nlsolve_discretizers import LinearTriangles, MovingLeastSquares
from nlsolve_laws import PowerLaw
from nlsolve_scenes import Channel
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.results.columns import DIAGNOSTICS
from nlsolve.running.diagnose import diagnose
from nlsolve.study.study import Study

STUDY = """\
question = "How sound are these operators?"

[scene]
kind = "channel"
spacing = 0.25

[law]
kind = "power-law"

[discretizer]
kind = "mls"

[solver]
kind = "newton"

[[sweep]]
grid = { "scene.jitter" = [0.0, 0.2], "law.index" = [1.0, 0.5], "scene.mean_speed" = [1.0, 100.0] }

[[sweep]]
each = [
    { name = "mls" },
    { name = "triangles", discretizer = { kind = "delaunay" } },
    { name = "flat", discretizer = { kind = "rbf", kernel = "gaussian", shape = 0.001 } },
]
"""

FLAT = "raise discretizer.shape or use the kernel phs"
SIZES = ["targets", "smallest_support", "largest_support", "grown"]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_study(tmp_path, text=STUDY)


def study(path: Path) -> Study:
    return Study.from_toml(path, {}, False)


def told(*arguments: object) -> str:
    result = CliRunner().invoke(app, ["diagnose", *map(str, arguments)])
    assert result.exit_code == 0, result.stderr
    return result.stdout


def test_a_row_an_operator_with_what_tells_the_case_apart(path: Path) -> None:
    frame = diagnose(study(path))
    swept = ["variant", "scene.jitter", "scene.mean_speed"]  # an index is no parameter of clouds or discretizers
    assert sorted(frame.columns[:3]) == sorted(swept)
    assert list(frame.columns[3:]) == ["nodes", *DIAGNOSTICS]
    mls = frame[(frame["variant"] == "mls") & (frame["scene.jitter"] == 0.2)]
    assert list(mls["operator"]) == ["strain", "force", "volume"]
    assert (mls["nodes"] == 81).all()


def test_the_rows_are_those_of_the_discretizers(path: Path) -> None:
    """The same numbers as from the discretizer itself on the same cloud."""
    frame = diagnose(study(path))
    cloud = Channel(spacing=0.25, jitter=0.2).cloud(PowerLaw())
    for variant, discretizer in (("mls", MovingLeastSquares()), ("triangles", LinearTriangles())):
        rows = frame[(frame["variant"] == variant) & (frame["scene.jitter"] == 0.2)]
        expected = discretizer.diagnostics(cloud)
        assert len(rows) == len(expected)
        for name in DIAGNOSTICS:
            assert list(rows[name]) == [row[name] for row in expected]
    sound = frame[frame["nodes"].notna()]
    assert sound["balance"].between(0.01, 1.0).all()
    assert (sound["reproduction_error"] < 1e-12).all()


def test_one_cloud_and_one_discretizer_are_shown_once(path: Path) -> None:
    """24 cases on two clouds by three discretizers: the law and the speed change no operator."""
    assert len(study(path).cases) == 24
    frame = diagnose(study(path))
    assert len(frame) == 2 * (3 + 1 + 1)
    assert not frame.duplicated(["variant", "scene.jitter", "operator"]).any()


def test_a_discretizer_that_refuses_leaves_its_sentence(path: Path) -> None:
    frame = diagnose(study(path))
    rows = frame[frame["variant"] == "flat"]
    assert list(rows["scene.jitter"]) == [0.0, 0.2]
    for sentence in rows["operator"]:
        assert sentence.startswith("the kernel 'gaussian' on the ")
        assert sentence.endswith(FLAT)
    assert rows[["nodes", *SIZES, "balance"]].isna().all(axis=None)


def test_a_cloud_that_refuses_leaves_its_sentence_once(tmp_path: Path) -> None:
    """A corner given twice."""
    side = np.linspace(-1.0, 1.0, 5)
    nodes = [(x, y) for x in np.linspace(0.0, 2.0, 5) for y in side]
    groups = {-1.0: "bottom", 1.0: "top"}
    lines = ["x,y,group", "0.5,0.5,"]
    for x, y in nodes:
        end = "inlet" if x == 0.0 else "outlet" if x == 2.0 else ""
        lines.append(f"{x},{y},{groups.get(y, end)}")
    (tmp_path / "nodes.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    place = json.dumps(str(tmp_path / "nodes.csv"))
    path = write_study(tmp_path, ("spacing = 0.25", f'nodes = {{ kind = "file", path = {place} }}'), text=STUDY)
    frame = diagnose(study(path))
    assert frame["operator"].str.contains("two nodes coincide at (0.5, 0.5): remove one of them", regex=False).all()
    assert len(frame) == 2 * 2 * 3


def test_a_discretizer_without_diagnostics_says_so(tmp_path: Path) -> None:
    """The stand-in of the tests: four nodes, and the contract's own answer."""
    frame = diagnose(Study.from_toml(write_study(tmp_path), {}, False, registry_of()))
    assert frame.dropna(axis=1).to_dict("records") == [
        {"nodes": 4, "operator": "this discretizer gives no diagnostics"}
    ]


def test_json(path: Path) -> None:
    rows: list[dict[str, Any]] = json.loads(told(path, "--set", "sweep=[]", "--json"))
    assert [row["operator"] for row in rows] == ["strain", "force", "volume"]
    assert rows[0]["nodes"] == 81
    assert rows[0]["smallest_support"] == rows[0]["largest_support"] == 10
    assert set(rows[0]) == {"nodes", *DIAGNOSTICS}


def test_json_of_a_refusal_has_nulls(path: Path) -> None:
    rows = json.loads(told(path, "--json"))
    assert len(rows) == 10
    flat = next(row for row in rows if row["variant"] == "flat")
    assert flat["operator"].endswith(FLAT)
    assert all(flat[name] is None for name in ("nodes", *SIZES, "largest_weight"))


def test_the_table_on_the_terminal(path: Path) -> None:
    text = told(path)
    for word in ("Operators, one row each", "variant", "scene.jitter", *DIAGNOSTICS, "strain", "volume", FLAT):
        assert word in text


def test_settings_are_heard(path: Path) -> None:
    rows = json.loads(told(path, "--set", "sweep=[]", "--set", "scene.spacing=0.5", "--json"))
    assert rows[0]["nodes"] == 25


def test_a_bad_study_is_2_in_one_sentence(path: Path) -> None:
    result = CliRunner().invoke(app, ["diagnose", str(path), "--set", "scene.spacng=1"])
    assert result.exit_code == 2
    assert "no such field; did you mean 'spacing'?" in result.stderr
