"""The version of the contract that a plugin was written for is checked before the plugin is imported."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint, version
from types import ModuleType

import pytest

from nlsolve.registry.installed.contract_version import CONTRACT_VERSION, text_of, unserved
from nlsolve.registry.plugin_files import load_file
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry

HERE = f"and nlsolve {version('nlsolve')} has 2.3"


@pytest.mark.parametrize(
    ("stated", "sentence"),
    [
        ('"2.3"', ""),
        ('"2.0"', ""),
        ('"2.4"', f"contract 2.4, {HERE}: install a newer nlsolve, or an older version of the plugin"),
        ('"3.0"', f"contract 3.0, {HERE}: install a newer nlsolve"),
        (
            '"1.9"',
            f"1.9, {HERE}: install a newer version of the plugin, or change it as CHANGELOG.md says, then nlsolve_",
        ),
        ("2.3", 'its nlsolve_contract = 2.3 is no version of the plugin contract: write nlsolve_contract = "2.3"'),
        ("str(2)", "its nlsolve_contract = 'str(2)' is no version"),
    ],
)
def test_what_a_plugin_was_written_for_and_what_is_here(stated: str, sentence: str) -> None:
    found = unserved(f"import nothing\nnlsolve_contract = {stated}\n", "2.3")
    assert sentence in found
    assert bool(found) == bool(sentence)


@pytest.mark.parametrize(
    "text", ["", "nlsolve_contract", "def f():\n    nlsolve_contract = '9.0'", "nlsolve_contract = ("]
)
def test_a_plugin_that_states_no_version_is_taken_as_it_is(text: str) -> None:
    assert unserved(text) == ""


def test_a_plugin_for_another_contract_is_a_row_and_is_not_imported(tmp_path, monkeypatch) -> None:
    later = "from nlsolve.plugin import NotYet\nnlsolve_contract = '99.0'\n"
    (tmp_path / "later_plugin.py").write_text(later, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    registry = Registry()
    registry.load(EntryPoint("later", "later_plugin", "nlsolve"))
    (row,) = registry.plugins()
    said = (
        f"the plugin 'later' cannot be used: it was written for plugin contract 99.0, and nlsolve {version('nlsolve')}"
    )
    assert str(row.failure).startswith(f"{said} has {CONTRACT_VERSION}: install a newer nlsolve")
    assert "later_plugin" not in sys.modules
    with pytest.raises(StudyError, match=r"later_plugin.py cannot be used: it was written for plugin contract 99.0"):
        load_file(tmp_path / "later_plugin.py")


def test_a_module_without_a_file_has_no_text(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "made_by_hand", ModuleType("made_by_hand"))
    for module in ("made_by_hand", "sys", "not_there"):
        assert text_of(EntryPoint("name", module, "nlsolve")) == ""
