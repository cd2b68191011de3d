"""`nlsolve check`: kinds and files are held to their contracts, with exit codes and sentences."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.cli.plugins import apart

LAW = """\
from typing import Any, Literal

from nlsolve.plugin import ConstitutiveLaw, Discretizer, LinearSolver


class Honey(ConstitutiveLaw):
    kind: Literal["honey-of-a-file"] = "honey-of-a-file"
    mu: float = 10.0

    def viscosity(self, rate_squared: Any) -> Any:
        return self.mu + 0.0 * rate_squared
"""


def told(*words: str) -> tuple[int, str, str]:
    result = CliRunner().invoke(app, ["check", *words])
    return result.exit_code, result.stdout, result.stderr


def test_a_kind_that_keeps_its_contract() -> None:
    code, table, said = told("every-m", "--set", "m=3")
    assert (code, said) == (0, "")
    assert "refresh every-m" in table
    assert "passed" in table
    assert "the same history gives the same answer" in table


def test_a_kind_of_several_contracts_is_checked_by_each() -> None:
    code, document, _ = told("newton", "--json")
    assert code == 0
    assert [(one["noun"], one["kind"], one["holds"]) for one in json.loads(document)] == [
        ("solver", "newton", True),
        ("form", "newton", True),
    ]


def test_a_file_with_two_laws_one_of_them_broken(tmp_path: Path) -> None:
    path = tmp_path / "laws.py"
    broken = LAW.partition("class")[2].replace("Honey", "Sour").replace("honey", "sour").replace("+ 0.0 *", "- 1.0 *")
    path.write_text(f"{LAW}\n\nclass{broken}", encoding="utf-8")
    code, table, said = told(str(path))
    assert code == 1
    assert "law honey-of-a-file" in table
    assert "FAILED" in table
    assert "the viscosity is not a positive finite number" in table
    assert "docs/plugins.md#constitutivelaw" in table
    assert said.splitlines() == [
        "law sour-of-a-file: does not keep its contract: positive, dissipation, far rates; "
        "see docs/plugins.md#constitutivelaw"
    ]
    assert told("honey-of-a-file", "--plugin", str(path))[0] == 0


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("import nothing_of_this_name", "cannot be imported: ModuleNotFoundError"),
        (
            LAW.replace("    def viscosity", "    @property\n    def viscosity").replace(", rate_squared: Any", ""),
            "Honey.viscosity is a property, and should be a method",
        ),
        ("x = 1", "it defines no component class with a kind"),
        (f'nlsolve_contract = "99.0"\n{LAW}', "cannot be used: it was written for plugin contract 99.0, and nlsolve "),
    ],
)
def test_a_file_that_cannot_be_registered_does_not_keep_its_contract(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "plugin.py"
    path.write_text(text, encoding="utf-8")
    code, document, said = told(str(path), "--json")
    assert code == 1
    assert sentence in json.loads(document)[0]["verdicts"][0]["failure"]
    assert said.startswith("file plugin.py: does not keep its contract: registered; see docs/plugins.md#")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["newtn"], "newtn: no plugin offers this kind; did you mean 'newton'?"),
        (["absent.py"], "the plugin absent.py cannot be read: there is no such file"),
        (["published"], "published: problem: Field required: give it by --set problem=VALUE"),
        (["every-m", "--set", "n=3"], "--set n: every-m has no such field"),
        (["every-m", "--set", "m=0"], "every-m: m: Input should be greater than"),
    ],
)
def test_what_cannot_be_checked(words: list[str], sentence: str) -> None:
    code, table, said = told(*words)
    assert (code, table) == (2, "")
    assert said.startswith(sentence)


ENDS = {
    "derivative": ("os._exit(3)", "ended the interpreter with exit code 3"),
    "shape": ("ctypes.string_at(0)", "ended the interpreter with SIGSEGV"),
    "series": ("os.kill(os.getpid(), signal.SIGSTOP)", "could not be stopped"),
}
"""Name of a check -> what a law does in it, and what is said."""


@pytest.mark.parametrize("name", ENDS)
def test_a_law_that_ends_its_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """The checks before that stand, the law behind it in the file is checked, and what it prints is no table."""
    what, sentence = ENDS[name]
    monkeypatch.setattr(apart, "SECONDS", 2.0)
    monkeypatch.setattr(apart, "GRACE", 1.0)
    asked = f'import ctypes, os, signal\nif running() == "{name}":\n    {what}\nprint("a word")\nreturn '
    body = "".join(f"        {line}\n" for line in asked.splitlines())
    text = LAW.replace("        return ", body.rstrip() + " ").replace(
        "class Honey", "from nlsolve.testing.kit import verdicts\n\n\ndef running():\n"
        "    return verdicts._REPORT.get().running[-1]\n\n\nclass Honey"
    )  # fmt: skip
    last = LAW.partition("class")[2].replace("Honey", "Water").replace("honey", "water")
    path = tmp_path / "laws.py"
    path.write_text(f"{text}\n\nclass{last}", encoding="utf-8")
    code, document, said = told(str(path), "--json")
    assert code == 1
    first, second = json.loads(document)
    assert (first["kind"], second["kind"], second["holds"]) == ("honey-of-a-file", "water-of-a-file", True)
    failed = {verdict["name"]: verdict["failure"] for verdict in first["verdicts"] if verdict["failure"]}
    assert all(verdict["reached"] for verdict in first["verdicts"])
    assert failed == {name: f'the check "{name}" {sentence}'}
    assert said.startswith(f"law honey-of-a-file: does not keep its contract: {name}; see")


def test_a_file_that_ends_the_process_as_it_is_imported(tmp_path: Path) -> None:
    path = tmp_path / "plugin.py"
    path.write_text("import os\nos._exit(0)\n", encoding="utf-8")
    code, document, said = told(str(path), "--json")
    assert code == 1
    (found,) = json.loads(document)
    assert found["verdicts"][0]["failure"] == 'the check "registered" ended the interpreter with exit code 0'
    assert said.startswith("file plugin.py: does not keep its contract: registered; see")


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("__import__('os')._exit(3)", 'the check "made" ended the interpreter with exit code 3'),
        ("raise TypeError('no')", "raised TypeError: no"),
    ],
)
def test_a_component_that_cannot_be_made(tmp_path: Path, what: str, sentence: str) -> None:
    path = tmp_path / "plugin.py"
    made = f"    def model_post_init(self, context: Any) -> None:\n        {what}\n\n"
    path.write_text(LAW.replace("    def viscosity", f"{made}    def viscosity"), encoding="utf-8")
    code, document, said = told(str(path), "--json")
    assert code == 1
    (found,) = json.loads(document)
    assert [verdict["failure"] for verdict in found["verdicts"]] == [sentence]
    assert said.startswith("law honey-of-a-file: does not keep its contract: made; see")
