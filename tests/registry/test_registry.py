"""The plugins' door: what is found, what fails alone, and what is said about it."""

from __future__ import annotations

import importlib.metadata
import sys
from pathlib import Path
from typing import Any, ClassVar, Literal

import pytest
from fakes import COMPONENTS, Homotopy, Honey, Newton, Plugin, registry_of
from pydantic import TypeAdapter, ValidationError

from nlsolve.plugin import NonlinearSolver, hookimpl
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.registry import Registry, load_registry, registry_in_use


class OtherNewton(Newton):
    """The same kind from somebody else."""


class NoKind(NonlinearSolver):
    """A solver that forgot its name."""

    def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
        return iter(())


class LooseKind(NoKind):
    """A name that is no literal."""

    kind: str = "loose"


class Qualified(NoKind):
    """A name with a package in it."""

    kind: Literal["mine:newton"] = "mine:newton"


class Unfinished(NonlinearSolver):
    """No steps."""

    kind: Literal["unfinished"] = "unfinished"


class Absent(Newton):
    """A solver whose library is not installed."""

    kind: Literal["absent"] = "absent"
    absent: ClassVar[str | None] = "needs the library absent: pip install absent"


class WithoutHook:
    """Nothing to register."""


class Misspelt:
    """A marked function that is no hook."""

    @hookimpl
    def nlsolve_component(self) -> Any:
        return [Newton]


class Empty:
    """A hook that forgot to return."""

    @hookimpl
    def nlsolve_components(self) -> Any:
        return None


class Asking:
    """A hook with an argument that nobody passes."""

    @hookimpl
    def nlsolve_components(self, registry: Any) -> Any:
        return [Newton]


class Uncomparable(Plugin):
    """An object that cannot be put into a set."""

    __hash__ = None  # type: ignore[assignment]


class Raising:
    """A hook that fails."""

    @hookimpl
    def nlsolve_components(self) -> Any:
        raise RuntimeError("no licence found\nsecond line")


def failures(registry: Registry) -> list[str]:
    return [row.failure for row in registry.plugins() if row.failure]


def test_classes_by_noun_and_kind():
    registry = registry_of()
    assert registry.classes("solver") == {"anm": Homotopy, "newton": Newton}
    assert registry.classes("law") == {"honey": Honey}
    assert registry.classes("nothing") == {}
    assert set(CONTRACTS) == {
        "scene",
        "law",
        "discretizer",
        "linear",
        "solver",
        "refresh",
        "operator",
        "predictor",
        "globalization",
        "range",
        "form",
    }


def test_rows_tell_source_and_parameters():
    rows = {(row.noun, row.kind): row for row in registry_of().plugins()}
    assert len(rows) == len(COMPONENTS)
    row = rows["solver", "anm"]
    order = row.parameters[0]
    assert (row.source, order.name, order.type, order.default, order.description) == (
        "fakes 1.0",
        "order",
        "int",
        20,
        "p",
    )


@pytest.mark.parametrize("classes", [(Newton, Homotopy), (Newton,)])
def test_union_of_many_or_one_asks_for_a_kind(classes):
    section = TypeAdapter(registry_of(*classes).union("solver"))
    assert section.validate_python({"kind": "newton"}) == Newton()
    assert section.validate_python(Newton()) == Newton()
    with pytest.raises(ValidationError, match="required, and missing; installed: "):
        section.validate_python({})
    with pytest.raises(ValidationError, match="no such solver; did you mean 'newton'"):
        section.validate_python({"kind": "newtn"})
    with pytest.raises(ValidationError, match="should be a table with a kind"):
        section.validate_python(3)
    with pytest.raises(ValidationError, match="no such solver"):
        section.validate_python({"kind": ["newton"]})


def test_a_kind_without_its_library_is_refused_in_its_own_words():
    registry = registry_of(Newton, Absent)
    sentence = "solver 'absent' needs the library absent: pip install absent"
    assert registry.classes("solver") == {"newton": Newton}
    assert failures(registry) == [sentence]
    with pytest.raises(ValidationError, match=sentence):
        TypeAdapter(registry.union("solver")).validate_python({"kind": "absent"})
    with pytest.raises(ValidationError, match=r"no such solver; did you mean 'newton'\? installed: newton \["):
        TypeAdapter(registry.union("solver")).validate_python({"kind": "newtn"})


def test_union_of_nothing():
    section = TypeAdapter(registry_of(Honey).union("solver"))
    with pytest.raises(ValidationError, match="no such solver; installed: none"):
        section.validate_python({"kind": "newton"})


def test_two_plugins_with_one_name():
    registry = registry_of(Newton, Homotopy)
    registry.add(Plugin(OtherNewton), "other 2.0")
    assert registry.classes("solver") == {"anm": Homotopy}
    sentence = "solver 'newton' is offered by fakes 1.0 and other 2.0: ask for 'fakes:newton' or 'other:newton'"
    assert registry.complaint("solver", "newton") == sentence
    section = TypeAdapter(registry.union("solver"))
    with pytest.raises(ValidationError, match=sentence):
        section.validate_python({"kind": "newton"})
    assert type(section.validate_python({"kind": "fakes:newton"})) is Newton
    assert type(section.validate_python({"kind": "other:newton"})) is OtherNewton
    assert failures(registry) == []
    assert [row.kind for row in registry.plugins()] == ["anm", "fakes:newton", "other:newton"]
    with pytest.raises(ValidationError, match="'third' offers no solver 'newton'; it is offered as fakes:newton"):
        section.validate_python({"kind": "third:newton"})
    with pytest.raises(ValidationError, match="'fakes' offers no solver 'nwton'; nothing offers a solver of this kind"):
        section.validate_python({"kind": "fakes:nwton"})


def test_the_first_party_kind_is_the_default():
    registry = Registry()
    registry.add(Plugin(OtherNewton), "other 2.0")
    registry.add(Plugin(Newton), "nlsolve 0.1")
    assert registry.classes("solver") == {"newton": Newton}
    assert registry.class_called("solver", "nlsolve:newton") is Newton
    assert registry.class_called("solver", "other:newton") is OtherNewton
    assert [registry.kind_of(solver) for solver in (Newton(), OtherNewton(), Homotopy())] == [
        "newton",
        "other:newton",
        None,
    ]
    assert [(row.kind, row.failure) for row in registry.plugins()] == [("other:newton", None), ("newton", None)]


def test_one_package_that_offers_a_kind_twice():
    registry = registry_of(Newton, OtherNewton)
    sentence = "solver 'fakes:newton' is offered by fakes 1.0 and fakes 1.0: uninstall all but one"
    assert registry.classes("solver") == {}
    assert failures(registry) == [sentence, sentence]


def test_a_registry_with_more_classes_leaves_the_first_as_it_was():
    registry = registry_of(Newton)
    wider = registry.with_([Homotopy], "more (more.py)", Path("more.py"))
    assert list(registry.classes("solver")) == ["newton"]
    assert list(wider.classes("solver")) == ["anm", "newton"]
    assert (registry.files, wider.files) == ((), (Path("more.py"),))
    assert wider.class_called("solver", "more:anm") is Homotopy
    assert registry_in_use() is load_registry()
    with wider.in_use():
        assert registry_in_use() is wider
    assert registry_in_use() is load_registry()


@pytest.mark.parametrize(
    ("plugin", "reason"),
    [
        (WithoutHook(), "TypeError: it has no function nlsolve_components marked with @hookimpl"),
        (
            Empty(),
            "TypeError: it has no function nlsolve_components marked with @hookimpl that returns component classes",
        ),
        (Misspelt(), "PluginValidationError: unknown hook 'nlsolve_component' in plugin"),
        (Asking(), "PluginValidationError: Plugin"),
        (Uncomparable(Homotopy), "TypeError: unhashable type"),
        (Raising(), "RuntimeError: no licence found"),
        (Plugin(int), "TypeError: <class 'int'> is not a subclass of one of Scene, ConstitutiveLaw, "),
        (Plugin(NoKind), 'NoKind must declare its name: kind: Literal["name"] = "name"'),
        (Plugin(LooseKind), 'LooseKind must declare its name: kind: Literal["name"] = "name"'),
        (Plugin(Qualified), "Qualified has the kind 'mine:newton': a kind has no ':', which packages end with"),
        (Plugin(Unfinished), "Unfinished leaves methods of its contract out: steps"),
    ],
)
def test_a_plugin_that_cannot_be_registered_fails_alone(plugin, reason):
    registry = registry_of(Newton)
    registry.add(plugin, "broken 0.1")
    assert registry.classes("solver") == {"newton": Newton}
    (failure,) = failures(registry)
    assert reason in failure
    assert "\n" not in failure
    assert registry.plugins()[-1].source == "broken 0.1"
    assert "1 plugin(s) failed, see `nlsolve plugins`" in str(registry.complaint("solver", "nwton"))


@pytest.mark.parametrize("plugin", [Raising(), Misspelt(), Asking(), Uncomparable(Homotopy), Plugin(int)])
def test_what_comes_after_a_failed_plugin_is_registered(plugin):
    registry = Registry()
    registry.add(plugin, "broken 0.1")
    registry.add(Plugin(Newton), "good 1.0")
    assert registry.classes("solver") == {"newton": Newton}
    assert len(failures(registry)) == 1


def test_a_plugin_registered_twice_counts_once():
    registry, plugin = Registry(), Plugin(Newton)
    registry.add(plugin, "fakes 1.0")
    registry.add(plugin, "fakes 1.0")
    assert registry.classes("solver") == {"newton": Newton}
    assert failures(registry) == ["the plugin cannot be registered: ValueError: it is registered already"]


def test_a_hook_is_asked_once():
    asked = []

    class Counting:
        @hookimpl
        def nlsolve_components(self) -> Any:
            asked.append(self)
            return [Newton]

    registry = Registry()
    registry.add(Counting(), "counting 1.0")
    registry.add(Plugin(Homotopy), "fakes 1.0")
    assert len(asked) == 1


def test_entry_points_are_loaded_one_at_a_time(tmp_path, monkeypatch):
    (tmp_path / "good_plugin.py").write_text(
        "import fakes\nfrom nlsolve.plugin import hookimpl\n\n\n"
        "@hookimpl\ndef nlsolve_components():\n    return [fakes.Newton]\n"
    )
    (tmp_path / "bad_plugin.py").write_text("import a_module_nobody_has\n")
    info = tmp_path / "strangers-3.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 3.1\n")
    (info / "entry_points.txt").write_text("[nlsolve]\na-bad-one = bad_plugin\nb-good-one = good_plugin\n")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    ours = [e for e in importlib.metadata.entry_points(group="nlsolve") if e.dist and e.dist.name == "strangers"]
    assert len(ours) == 2
    monkeypatch.setattr("nlsolve.registry.installed.entries.entry_points", lambda group: ours)
    registry = Registry.installed()
    assert list(registry.classes("solver")) == ["newton"]
    good, bad = registry.plugins()
    assert good.source == "strangers 3.1 (good_plugin)"
    assert bad.source == "strangers 3.1 (bad_plugin)"
    assert bad.failure == (
        "the plugin 'a-bad-one' cannot be imported: ModuleNotFoundError: No module named 'a_module_nobody_has'"
    )


def test_the_installed_registry_is_loaded_once():
    assert load_registry() is load_registry()


def test_the_default_kind_of_a_contract_is_installed():
    defaults = {noun: contract.default_kind for noun, contract in CONTRACTS.items() if contract.default_kind}
    assert defaults == {"linear": "auto", "operator": "tangent", "predictor": "previous"}
    for noun, kind in defaults.items():
        assert kind in load_registry().classes(noun)
