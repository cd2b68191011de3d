"""The command line: what is printed where, and the exit codes."""

from __future__ import annotations

import json
import os
from importlib.metadata import version

import pytest
from fakes import STUDY, Newton, Plugin, fake_march, registry_of, write_study
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.registry.registry import DISABLE, load_registry

BARS = {"FORCE_COLOR": "1", "TERM": "xterm", "COLUMNS": "200"}


@pytest.fixture(autouse=True)
def fake(monkeypatch, tmp_path):
    monkeypatch.setattr("nlsolve.study.study.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", fake_march)
    monkeypatch.chdir(tmp_path)


def nlsolve(*arguments: object, env: dict[str, str] | None = None):
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], env=env)
    assert "Traceback" not in result.output
    return result


def test_run_prints_tables_on_stdout_and_progress_on_stderr(tmp_path):
    result = nlsolve("run", write_study(tmp_path))
    assert result.exit_code == 0
    assert "solver.tolerance = 1e-06" in result.stdout
    told = result.stderr.splitlines()
    second = next(line for line in told if line.startswith("case 2/4"))
    assert second.startswith("case 2/4, converged, 4 factorisations")
    assert second.endswith("(solver.order = 10, solver.tolerance = 1e-08)")
    assert "s left" in result.stderr
    assert "4 cases: 4 converged; results in results/study" in result.stderr
    assert "cases:" not in result.stdout
    assert (tmp_path / "results" / "study" / "runs.csv").exists()
    again = nlsolve("run", write_study(tmp_path))
    assert "converged before" in again.stderr


def test_run_shows_a_bar_on_a_terminal(tmp_path):
    result = nlsolve("run", write_study(tmp_path), env=BARS)
    assert result.exit_code == 0
    assert "case 4/4" in result.stderr
    assert "━" in result.stderr


def test_run_json_quick_set_and_out(tmp_path):
    path = write_study(tmp_path)
    result = nlsolve(
        "run", path, "--quick", "--set", "solver.order=5", "--set", "law.index=0.25", "--json", "--out", "o"
    )
    document = json.loads(result.stdout)
    assert (document["study"], document["folder"], len(document["runs"])) == ("study", "o", 1)
    (row,) = document["runs"]
    assert (row["solver.order"], row["law.index"], row["scene.side"], row["velocity_error"]) == (5, 0.25, "right", None)
    assert document["tables"]["branches"] == [{"solver.order": "5", "solver.tolerance = 1e-06": 120}]
    assert nlsolve("run", path, "--quick").exit_code == 0
    assert (tmp_path / "results" / "study-quick").is_dir()


def test_run_without_tables_lists_endings(tmp_path):
    result = nlsolve("run", write_study(tmp_path), "--set", "table=[]")
    assert "the stopping test was met" in result.stdout


def test_table_of_a_study_without_tables_lists_endings_by_what_differs(tmp_path):
    nlsolve("run", write_study(tmp_path), "--set", "table=[]", "--out", "o")
    told = nlsolve("table", "o").stdout
    assert told.count("the stopping test was met") == 4
    assert "solver.order" in told
    assert "scene.side" not in told


def test_divergence_is_a_result(tmp_path, monkeypatch):
    def march(parts, listen, clock, **way):
        record = fake_march(parts, listen)
        record.summary["status"] = "diverged"
        return record

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    result = nlsolve("run", write_study(tmp_path))
    assert result.exit_code == 0
    assert "4 cases: 4 diverged" in result.stderr
    assert " (one of 4) ended as diverged: " in result.stderr


def test_a_crash_is_1(tmp_path, monkeypatch):
    def march(parts, listen, clock, **way):
        raise RuntimeError("[oops]")

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    result = nlsolve("run", write_study(tmp_path))
    assert result.exit_code == 1
    assert "crashed: RuntimeError: [oops] (" in result.stderr


def test_an_interruption_is_130_and_keeps_what_is_finished(tmp_path, monkeypatch):
    count = 0

    def march(parts, listen, clock, **way):
        nonlocal count
        count += 1
        if count == 2:
            raise KeyboardInterrupt
        return fake_march(parts, listen)

    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", march)
    result = nlsolve("run", write_study(tmp_path), "--out", "o")
    assert result.exit_code == 130
    assert "interrupted; the finished cases are in o and the same command does the rest" in result.stderr
    table = nlsolve("table", "o", "--json")
    assert json.loads(table.stdout)["branches"] == [{"solver.order": "10", "solver.tolerance = 1e-06": 60}]
    monkeypatch.setattr("nlsolve.running.engines.execution.run_case", fake_march)
    assert nlsolve("run", write_study(tmp_path), "--out", "o").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["run", "nowhere.toml"], "nowhere.toml: the study cannot be read: No such file or directory"),
        (["run", "study.toml", "--set", "solver.ordr=3"], "no such field; did you mean 'order'?"),
        (["validate", "study.toml", "--set", "solver.kind=amn"], "no such solver; did you mean 'anm'?"),
        (["plan", "study.toml", "--set", "nonsense"], "--set nonsense: expected key=value"),
        (["run", "study.toml", "--out", "study.toml/o"], "cannot be written there (Not a directory)"),
        (["table", "nowhere"], "not a results folder"),
    ],
)
def test_invalid_input_is_2_in_one_sentence(tmp_path, arguments, sentence):
    write_study(tmp_path)
    result = nlsolve(*arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert result.stdout == ""


def test_a_folder_takes_the_study_with_other_settings(tmp_path):
    path = write_study(tmp_path)
    assert nlsolve("run", path).exit_code == 0
    assert nlsolve("run", path, "--set", "law.index=0.3").exit_code == 0
    assert nlsolve("run", path).stderr.count("converged before") == 4


def test_table(tmp_path):
    nlsolve("run", write_study(tmp_path), "--out", "o")
    assert "solver.tolerance = 1e-06" in nlsolve("table", "o").stdout
    assert "60" in nlsolve("table", "o", "branches").stdout
    wrong = nlsolve("table", "o", "brances")
    assert (wrong.exit_code, wrong.stderr.strip()) == (2, "o: there is no table 'brances'; did you mean 'branches'?")


def test_table_tells_whether_a_paper_is_stale(tmp_path):
    path = write_study(tmp_path)
    nlsolve("run", path, "--set", "law.index=0.25", "--out", "o")
    table = tmp_path / "o" / "tables" / "branches.tex"
    written = table.read_text(encoding="utf-8")
    assert written.startswith("% Table branches of the study study, written by nlsolve run ")
    assert "study.toml --set law.index=0.25 --out o\n" in written
    assert (tmp_path / "o" / "tables" / "preamble.tex").exists()
    (tmp_path / "paper.tex").write_text("\\input{o/tables/branches}", encoding="utf-8")
    fresh = nlsolve("table", "o", "--check", "paper.tex")
    assert (fresh.exit_code, fresh.stdout.endswith(": table branches: as the results say\n")) == (0, True)
    table.write_text(written.replace('"content": "', '"content": "0'), encoding="utf-8")
    stale = nlsolve("table", "o", "--check", "paper.tex")
    assert stale.exit_code == 3
    assert "table branches: stale, the results tell something else now; a fresh one is" in stale.stdout
    assert json.loads(nlsolve("table", "o", "--check", "paper.tex", "--json").stdout)[0]["table"] == "branches"
    missing = nlsolve("table", "o", "--check", "nowhere.tex")
    assert (missing.exit_code, missing.stderr) == (2, "nowhere.tex: cannot be read: No such file or directory\n")


def test_validate(tmp_path):
    path = write_study(tmp_path)
    assert nlsolve("validate", path).stdout == f"{path} is valid: 4 cases (1 with --quick). How many branches?\n"
    assert nlsolve("validate", path, "--quick").stdout == f"{path} is valid: 1 case. How many branches?\n"
    document = json.loads(nlsolve("validate", path, "--json").stdout)
    assert document == {"study": "study", "question": "How many branches?", "cases": 4, "quick_cases": 1}
    bad = write_study(tmp_path, ('"scene.side" = "right"', '"scene.sid" = "right"'))
    result = nlsolve("validate", bad)
    assert result.exit_code == 2
    assert "line 25: scene.sid = 'right': no such field; did you mean 'side'?" in result.stderr


def test_plan(tmp_path):
    path = write_study(tmp_path)
    result = nlsolve("plan", path)
    assert result.exit_code == 0
    assert "4 cases" in result.stdout
    assert "then one factorisation and 20 pairs of triangular solves an increment" in result.stdout
    cases = json.loads(nlsolve("plan", path, "--set", "time.horizon=1e-3", "--json").stdout)["cases"]
    assert [(row["increments"], row["nodes"], row["unknowns"]) for row in cases] == [(10, 4, 2)] * 4
    first = cases[0]
    assert first["seconds_increment"] > first["seconds_factorization"] + 20 * first["seconds_triangular_solve"]
    assert first["seconds_iteration"] > first["seconds_factorization"] + first["seconds_triangular_solve"]
    assert first["seconds"] == pytest.approx(10 * first["seconds_increment"])
    assert first["seconds_start"] == pytest.approx(2 * 5 * first["seconds_iteration"])  # n = 1 and the target
    assert first["seconds_all"] == pytest.approx(
        first["seconds_start"] + first["seconds"] + first["seconds_operators"]  # fixed nodes have one cloud
    )


def test_plan_says_what_is_run_and_why(tmp_path, monkeypatch):
    path = write_study(tmp_path)
    assert "4 new (results in results/study)" in nlsolve("plan", path).stdout
    assert not (tmp_path / "results").exists()
    nlsolve("run", path, "--out", "o", "--set", 'sweep=[{grid={"solver.order"=[10],"solver.tolerance"=[1e-6]}}]')
    told = nlsolve("plan", path, "--out", "o")
    assert "3 new, 1 kept (results in o)" in told.stdout
    assert "s to run 3 cases" in told.stdout
    assert "(forecast: from the seconds of 1 case of this study" in told.stdout
    document = json.loads(nlsolve("plan", path, "--out", "o", "--json").stdout)
    assert document["folder"] == "o"
    assert [row["plan"] for row in document["cases"]] == ["kept", "new", "new", "new"]


def test_table_says_how_much_of_the_plan_is_finished(tmp_path):
    path = write_study(tmp_path)
    nlsolve("run", path, "--out", "o")
    assert nlsolve("table", "o").stderr == ""
    for part in list((tmp_path / "o" / "cases").glob("*.json"))[:3]:
        part.unlink()
    assert nlsolve("table", "o").stderr == "o: 1 of 4 cases are finished\n"


def test_plugins_and_why_one_failed(monkeypatch):
    registry = registry_of()
    registry.add(Plugin(Newton), "another 2.0")
    registry.add(object(), "broken 0.1")
    monkeypatch.setattr("nlsolve.cli.options.load_registry", lambda: registry)
    result = nlsolve("plugins")
    assert result.exit_code == 0
    unfolded = " ".join(result.stdout.split())
    assert "fakes:newton" in unfolded
    assert "another:newton" in unfolded
    assert "it has no function nlsolve_components" in unfolded
    assert "fakes:newton" in nlsolve("plugins", "solver", "newton").stdout
    (line,) = [line for line in nlsolve("plugins", "solver", "anm").stdout.splitlines() if "order" in line]
    assert line.split() == ["order", "20", "int", "p"]
    rows = json.loads(nlsolve("plugins", "--json").stdout)
    anm = next(row for row in rows if row["kind"] == "anm")
    assert anm["parameters"][0] == {"name": "order", "type": "int", "default": 20, "description": "p"}
    assert rows[-1]["source"] == "broken 0.1"


def test_what_is_installed_is_a_page_and_one_kind_of_it_is_told_in_detail(monkeypatch):
    monkeypatch.setattr("nlsolve.cli.options.load_registry", load_registry)
    page = nlsolve("plugins").stdout.splitlines()
    assert len(page) < 40
    assert max(map(len, page)) <= 110
    assert "Version 1.0 of the plugin contract." in page
    of_newton = nlsolve("plugins", "solver", "newton").stdout
    assert "K* w = −R(u), u ← u + t w" in of_newton
    assert "the step length t is found" in of_newton
    assert nlsolve("plugins", "form", "newton").stdout.startswith("form newton\n")
    both = json.loads(nlsolve("plugins", "newton", "--json").stdout)
    assert [row["noun"] for row in both] == ["solver", "form"]
    result = nlsolve("plugins", "solver", "nwton")
    assert (result.exit_code, result.stderr) == (
        2,
        "solver nwton: no such section or kind; did you mean 'newton'?\n",
    )


def test_plugins_lists_the_fields_of_sections_without_kinds(monkeypatch):
    monkeypatch.setattr("nlsolve.cli.options.load_registry", registry_of)
    rows = {row["noun"]: row for row in json.loads(nlsolve("plugins", "--json").stdout) if not row["kind"]}
    assert set(rows) == {"physics", "time", "motion", "start", "record", "stop", "budget", "limits"}
    assert rows["time"]["source"] == "nlsolve, for every scene"
    assert [field["name"] for field in rows["time"]["parameters"]] == ["horizon", "increment"]
    assert "divergence_tolerance" in nlsolve("plugins", "physics").stdout
    assert "divergence_tolerance" not in nlsolve("plugins").stdout


def test_many_rows_are_lines_without_rules(tmp_path):
    orders = ("[10, 20]", str(list(range(2, 303))))
    lines = nlsolve("plan", write_study(tmp_path, orders)).stdout.splitlines()
    assert lines[0] == "602 cases"
    assert lines[1].split()[:4] == ["case", "plan", "solver.order", "solver.tolerance"]
    assert [line.split()[1:4] for line in lines[2:4]] == [["new", "2", "1e-06"], ["new", "2", "1e-08"]]
    assert "━" not in "".join(lines)
    tall = (
        ('columns = "solver.tolerance"\n', ""),
        ('rows = "solver.order"', 'rows = ["solver.order", "solver.tolerance"]'),
    )
    printed = nlsolve("run", write_study(tmp_path, orders, *tall)).stdout
    assert "branches\nsolver.order  solver.tolerance  tangents\n2             1e-06             " in printed


EXPECT = """
[[expect]]
that = "Order 20 needs few tangents."
column = "tangents"
where = { "solver.order" = 20 }
at_most = 40
[[expect]]
table = "branches"
column = "solver.tolerance = 1e-06"
by = "solver.order"
order = [20, 10]
[quick]"""


def test_findings_are_judged_and_3_says_that_one_does_not_hold(tmp_path):
    result = nlsolve("run", write_study(tmp_path, ("\n[quick]", EXPECT)))
    assert result.exit_code == 0
    assert "found, as expected: Order 20 needs few tangents.\n" in result.stderr
    wrong = ("at_most = 40", "at_most = 39")
    path = write_study(tmp_path, ("\n[quick]", EXPECT), wrong)
    result = nlsolve("run", path)
    assert result.exit_code == 3
    assert "not found, though expected: Order 20 needs few tangents: case " in result.stderr
    findings = json.loads(nlsolve("run", path, "--json").stdout)["findings"]
    assert [bool(finding["refutation"]) for finding in findings] == [True, False]
    assert nlsolve("run", path, "--quick").exit_code == 0
    quick = ("sweep = [{", 'expect = [{ column = "tangents", at_most = 0 }]\nsweep = [{')
    assert nlsolve("run", write_study(tmp_path, quick), "--quick").exit_code == 3


def test_what_is_left_out_is_said(tmp_path):
    rule = '[[exclude]]\nwhere = { "solver.order" = 20 }\nreason = "it takes a day"\n[quick]'
    path = write_study(tmp_path, ("[quick]", rule))
    for command in ("validate", "plan", "run"):
        assert "left out: 2 cases: it takes a day\n" in nlsolve(command, path).stderr
    excluded = json.loads(nlsolve("validate", path, "--json").stdout)["excluded"]
    assert excluded[0] == {"label": "solver.order = 20, solver.tolerance = 1e-06", "reason": "it takes a day"}


HALF = """
from typing import Any, Literal

from nlsolve.plugin import NonlinearSolver, Step


class Half(NonlinearSolver):
    kind: Literal["half"] = "half"

    def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
        yield Step(start)
"""


def test_a_plugin_of_one_file(tmp_path):
    path = write_study(tmp_path, ('kind = "anm"', 'kind = "half"'), text=STUDY[: STUDY.index("[[sweep]]")])
    assert nlsolve("validate", path).exit_code == 2
    (tmp_path / "half.py").write_text(HALF, encoding="utf-8")
    for command in ("validate", "run"):
        assert nlsolve(command, path, "--plugin", "half.py").exit_code == 0
    assert "from half (half.py): half\n" in nlsolve("plugins", "--plugin", "half.py").stdout
    result = nlsolve("plan", path, "--plugin", "nowhere.py")
    assert (result.exit_code, result.stderr) == (
        2,
        "the plugin nowhere.py cannot be read: No such file or directory\n",
    )


def test_the_schema_has_what_is_installed(tmp_path):
    (tmp_path / "half.py").write_text(HALF, encoding="utf-8")
    document = json.loads(nlsolve("schema", "--plugin", "half.py").stdout)
    kinds = {
        kind
        for part in document["$defs"].values()
        for kind in part.get("properties", {}).get("kind", {}).get("enum", [])
    }
    assert {"box", "anm", "half", "half:half"} <= kinds


def test_a_disabled_plugin(monkeypatch, tmp_path):
    monkeypatch.setenv(DISABLE, "systems")
    monkeypatch.setattr("nlsolve.cli.options.load_registry", load_registry)
    result = nlsolve("plugins", "--disable-plugin", "solvers")
    assert "nlsolve 0.1.0 (nlsolve_solvers)" in result.stdout
    assert "disabled" in result.stdout
    assert "levenberg-marquardt" not in result.stdout
    assert "bratu" not in result.stdout
    assert os.environ[DISABLE] == "systems,solvers"
    result = nlsolve("validate", write_study(tmp_path), "--disable-plugin", "solver")
    assert (result.exit_code, result.stderr) == (
        2,
        "--disable-plugin solver: no such plugin; did you mean 'solvers'?\n",
    )


def test_version():
    assert nlsolve("--version").stdout == f"nlsolve {version('nlsolve')}\n"


def test_the_help_names_the_section_of_the_shrunk_study():
    assert "[quick]" in nlsolve("run", "--help").stdout
