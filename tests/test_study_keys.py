"""docs/study-keys.md tells the truth: it follows from the schema of studies, of the plugins that ship with nlsolve.

After a change of a field or its description, `.venv/bin/python tests/test_study_keys.py` writes the page anew.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fakes import Plugin

from nlsolve.contracts.scene import Scene
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.installed.entries import installed_plugins, names_of
from nlsolve.registry.offers import FIRST_PARTY
from nlsolve.registry.registry import Registry
from nlsolve.study.case import COMMON, Composer, sections_of
from nlsolve.study.keys.schema import study_schema
from nlsolve.study.study import Frame

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "study-keys.md"
Schema = dict[str, Any]

INTRODUCTION = """\
# All keys of a study

This page is generated from the plugins that ship with nlsolve: `.venv/bin/python tests/test_study_keys.py` writes it
anew, and a test holds it to them. `nlsolve schema` prints the same as a JSON schema, with the plugins that you have
installed, for editors that check and complete TOML files. A kind may be qualified by the package that offers it:
`kind = "nlsolve:newton"`.

A key with a dot is a key of a table inside: `paper.values` is written `paper = { values = … }`, or as a table
`[table.paper]`. Where a key takes any of several kinds, the keys of each kind follow it.
"""

SCALAR = {"boolean", "integer", "number", "string"}


def first_party() -> Registry:
    """The plugins that ship with nlsolve, whatever else is installed."""
    others = {entry.name for entry in installed_plugins() if FIRST_PARTY not in names_of(entry)}
    return Registry.installed(others)


class Page:
    """The page of one schema."""

    def __init__(self, registry: Registry) -> None:
        self.registry = registry
        self.schema = study_schema(registry, absent_too=True)
        self.definitions = self.schema["$defs"]
        self.sections = Composer(registry).all_sections

    def text(self) -> str:
        parts = [INTRODUCTION, *self.entries(), *self.all_sections(), *self.fields_of_kinds()]
        return "\n".join(parts)

    def entries(self) -> Iterator[str]:
        """What is not a section of a case."""
        properties = {name: part for name, part in self.schema["properties"].items() if name in Frame.model_fields}
        yield "## Entries\n\n" + self.table(properties, ["question"], inside=False)
        for name, part in properties.items():
            models = list(self.models(part))
            if models:
                heading = f"[[{name}]]" if part.get("type") == "array" else f"[{name}]"
                yield f"## `{heading}`\n"
                for model in models:
                    yield from self.model(model, "###" if len(models) > 1 else "")

    def all_sections(self) -> Iterator[str]:
        """The sections of cases, each with its kinds."""
        scenes = self.registry.offered(Scene.noun, absent_too=True)
        yield "## `[scene]`\n\nEvery study names a kind of scene, which decides what other sections there are.\n"
        yield from self.kinds(Scene.noun)
        for name, section in self.sections.items():
            askers = [kind for kind, scene in scenes.items() if name in sections_of(scene)]
            whom = (
                "For every scene" if name in COMMON else f"For the scenes {', '.join(f'`{kind}`' for kind in askers)}"
            )
            default = section.default_table
            if section.of:
                whom += f"; the default follows from the {section.of}"
            elif default is not None:
                whom += f"; by default `{toml(dict(default))}`"
            yield f"## `[{name}]`\n\n{whom}.\n"
            noun = section.contract.noun
            if CONTRACTS.get(noun) is not section.contract:
                yield from self.model(self.definition(self.schema["properties"][name]), "")
            elif name == noun:
                yield from self.kinds(noun)
            else:
                yield f"Its kinds are those of `[{noun}]`.\n"

    def fields_of_kinds(self) -> Iterator[str]:
        """Contracts that have no section: their components are fields of others."""
        for noun in CONTRACTS:
            if noun != Scene.noun and noun not in self.sections:
                yield f"## `{noun} = {{ kind = … }}`\n\nA field of other components.\n"
                yield from self.kinds(noun)

    def kinds(self, noun: str) -> Iterator[str]:
        for part in self.definitions[noun]["anyOf"]:
            yield from self.model(self.definition(part), "###")

    def model(self, model: Schema, heading: str) -> Iterator[str]:
        """A heading with the kind, the first sentence, and a table of the keys."""
        kind = kinds_of(model)
        if heading:
            yield f"{heading} `{kind[0]}`\n"
        said = re.split(r"\n\s*\n", model.get("description", ""))[0].strip()
        if said:
            yield " ".join(said.split()) + "\n"
        properties = {name: part for name, part in model["properties"].items() if name != "kind" or not kind}
        if properties:
            yield self.table(properties, model.get("required", []))

    def table(self, properties: Schema, required: list[str], inside: bool = True) -> str:
        rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
        rows += list(self.rows(properties, required, "", "", inside))
        return "\n".join(rows) + "\n"

    def rows(self, properties: Schema, required: list[str], above: str, of: str, inside: bool) -> Iterator[str]:
        for name, part in properties.items():
            default = "required" if name in required else shown(part.get("default"))
            meaning = " ".join(part.get("description", "").split())
            yield f"| `{above}{name}` | {self.words(part)} | {default} | {escaped(of + meaning)} |"
            for model in self.models(part) if inside else ():
                kind = kinds_of(model)
                which = f"(kind {kind[0]}) " if kind else ""
                fields = {field: each for field, each in model["properties"].items() if field != "kind" or not kind}
                yield from self.rows(fields, model.get("required", []), f"{above}{name}.", which, inside)

    def models(self, part: Schema) -> Iterator[Schema]:
        """The models in a schema that are described beside it; kinds of a contract have their own place."""
        if "$ref" in part and part["$ref"].rpartition("/")[2] not in CONTRACTS:
            yield self.definition(part)
        for several in ("anyOf", "oneOf", "allOf"):
            for one in part.get(several, []):
                yield from self.models(one)
        if isinstance(part.get("items"), dict):
            yield from self.models(part["items"])

    def definition(self, part: Schema) -> Schema:
        return self.definitions[part["$ref"].rpartition("/")[2]]

    def words(self, part: Schema) -> str:
        """The values that a key may have."""
        if "$ref" in part:
            name = part["$ref"].rpartition("/")[2]
            if name in CONTRACTS:
                return f"a {name}, `{{ kind = … }}`"
            kind = kinds_of(self.definition(part))
            return f'`{{ kind = "{kind[0]}" }}`' if kind else "table"
        for several in ("anyOf", "oneOf", "allOf"):
            if several in part:
                words = list(dict.fromkeys(filter(None, map(self.words, part[several]))))
                kinds = [word for word in words if word.startswith("`{ kind")]
                if len(kinds) > 3:
                    words = ["table with a kind", *(word for word in words if word not in kinds)]
                if set(words) >= SCALAR:
                    words = ["value", *(word for word in words if word not in SCALAR)]
                return " or ".join(words)
        if "const" in part:
            return f"`{toml(part['const'])}`"
        if "enum" in part:
            return " or ".join(f"`{toml(value)}`" for value in part["enum"])
        return self.of_type(part)

    def of_type(self, part: Schema) -> str:
        kind = part.get("type")
        if kind == "array":
            if "prefixItems" in part:
                return f"[{', '.join(map(self.words, part['prefixItems']))}]"
            return f"list of {self.words(part['items'])}" if part.get("items") else "list"
        if kind == "object":
            values = part.get("additionalProperties")
            return f"table of {self.words(values)}" if isinstance(values, dict) and values else "table"
        bounds = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
        limits = [f"{sign} {part[name]:g}" for name, sign in bounds.items() if name in part]
        return " ".join([{None: "any", "null": ""}.get(kind, kind or ""), ", ".join(limits)]).strip()


def kinds_of(model: Schema) -> list[str]:
    """The kinds by which a study asks for a model; empty for a model without a kind."""
    kind = model["properties"].get("kind", {})
    if "const" in kind:
        return [kind["const"]]
    return kind.get("enum", []) if "kind" in model.get("required", []) else []


def toml(value: Any) -> str:
    """A value as it is written in a study."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {toml(each)}" for name, each in value.items()) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def shown(default: Any) -> str:
    return "–" if default in (None, "", {}, []) else f"`{toml(default)}`"


def escaped(text: str) -> str:
    return text.replace("|", "\\|")


def test_the_page_says_what_the_schema_says():
    assert PAGE.read_text(encoding="utf-8") == Page(first_party()).text(), (
        "run .venv/bin/python tests/test_study_keys.py"
    )


def test_every_entry_and_section_is_on_the_page():
    page = PAGE.read_text(encoding="utf-8")
    for name in (*Composer(first_party()).sections, "timing", "sweep", "table", "figure", "expect", "exclude"):
        assert f"## `[{name}]`" in page or f"## `[[{name}]]`" in page, name
    assert {name for name in Frame.model_fields if f"| `{name}` |" not in page} == set()


def test_every_entry_and_every_field_of_it_says_what_it_means():
    wordless = re.findall(r"^\| `([\w.]+)` .* \| *\|$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert wordless == []


@pytest.fixture(scope="module")
def validator() -> Any:
    jsonschema = pytest.importorskip("jsonschema")
    schema = study_schema(Registry.installed(), absent_too=True)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(json.loads(json.dumps(schema)))


@pytest.mark.parametrize("path", sorted((ROOT / "studies").rglob("*.toml")), ids=lambda path: path.stem)
def test_shipped_studies_follow_the_schema(validator, path):
    assert [error.message for error in validator.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))] == []


STUDY: Schema = {"question": "q", "scene": {"kind": "bratu"}, "solver": {"kind": "anm", "order": 20}}


@pytest.mark.parametrize(
    "change",
    [
        {"solver": {"kind": "nwton"}},
        {"solver": {"kind": "anm", "ordr": 20}},
        {"solver": {"kind": "anm", "order": "20"}},
        {"solver": {"order": 20}},
        {"solver": {"kind": "newton", "globalization": {"kind": "nothing"}}},
        {"table": [{"name": "t", "row": "solver.order"}]},
        {"question": ""},
        {"sover": {"kind": "newton"}},
    ],
)
def test_the_schema_refuses_what_a_study_refuses(validator, change):
    assert list(validator.iter_errors(STUDY)) == []
    assert list(validator.iter_errors(STUDY | change)) != []


@pytest.mark.parametrize(
    "change",
    [
        {"solver": {"kind": "anm", "range": "ratio"}},
        {"solver": {"kind": "anm", "range": {"kind": "nlsolve:ratio"}}},
        {"solver": {"kind": "nlsolve:newton"}},
        {"refresh": {"m": 3}},
        {"sweep": [{"grid": {"solver.order": {"range": [5, 20, 5]}}}, {"repeat": {"times": 3, "seeds": "scene.seed"}}]},
        {"expect": [{"column": "tangents", "at_most": 3}], "exclude": [{"where": {"solver.order": 5}, "reason": "r"}]},
    ],
)
def test_the_schema_takes_every_way_to_write_a_thing(validator, change):
    assert [error.message for error in validator.iter_errors(STUDY | change)] == []


def test_a_strangers_kinds_are_in_the_schema():
    registry = first_party()
    newton = registry.classes("solver")["newton"]

    class Mine(newton):  # type: ignore[misc, valid-type]
        """Somebody else's."""

    registry.add(Plugin(Mine), "my-package 1.0")
    schema = study_schema(registry)
    kinds = [
        schema["$defs"][part["$ref"].rpartition("/")[2]]["properties"]["kind"]["enum"]
        for part in schema["$defs"]["solver"]["anyOf"]
    ]
    assert ["newton", "nlsolve:newton"] in kinds
    assert ["my-package:newton"] in kinds


def write() -> None:
    """Write the page anew."""
    PAGE.write_text(Page(first_party()).text(), encoding="utf-8")


if __name__ == "__main__":
    write()
