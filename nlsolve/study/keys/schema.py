"""The JSON schema of a study file, composed from the installed plugins."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema

from nlsolve.contracts.scene import Scene, Section
from nlsolve.registry.classes import CONTRACTS
from nlsolve.registry.nested import BY_NAME, CONTRACT
from nlsolve.registry.registry import Registry
from nlsolve.study.case import Composer
from nlsolve.study.study import Frame

DIALECT = "https://json-schema.org/draft/2020-12/schema"
DEFINITIONS = "$defs"
Schema = dict[str, Any]


class _Generator(GenerateJsonSchema):
    """A field that holds a component of a contract refers to all its kinds."""

    def model_schema(self, schema: Any) -> Schema:
        cls = schema["cls"]
        if cls in CONTRACTS.values():
            return {CONTRACT: cls.noun}
        return super().model_schema(schema)

    def encode_default(self, dft: Any) -> Any:
        """The default as JSON, without the fields that have their own defaults."""
        if isinstance(dft, BaseModel):
            return dft.model_dump(mode="json", exclude_defaults=True)
        return super().encode_default(dft)


def study_schema(registry: Registry, absent_too: bool = False) -> Schema:
    """The schema of study files (JSON Schema, draft 2020-12).

    absent_too : whether kinds whose libraries are not installed are described as well.
    """
    composer = Composer(registry)
    sections = {Scene.noun: Section(Scene), **composer.all_sections}
    kinds = {noun: registry.offered(noun, absent_too) for noun in CONTRACTS}
    classes: list[type[BaseModel]] = [Frame, *(cls for offered in kinds.values() for cls in offered.values())]
    classes += [section.contract for section in sections.values() if section.contract not in CONTRACTS.values()]
    with registry.in_use():
        references, made = models_json_schema(
            [(cls, "validation") for cls in dict.fromkeys(classes)], schema_generator=_Generator
        )
    definitions = dict(made[DEFINITIONS])
    for noun, offered in kinds.items():
        definitions[noun] = {"title": noun, "anyOf": [references[cls, "validation"] for cls in offered.values()]}
        for kind, cls in offered.items():
            name = references[cls, "validation"]["$ref"].rpartition("/")[2]
            definitions[name] = _asked_for(definitions[name], registry, noun, kind)
    frame = definitions.pop(references[Frame, "validation"]["$ref"].rpartition("/")[2])
    of_sections = {name: _section(section, references) for name, section in sections.items()}
    whole = {
        "$schema": DIALECT,
        "title": "A study of nlsolve",
        "type": "object",
        "additionalProperties": False,
        "properties": frame["properties"] | of_sections,
        "anyOf": [{"required": ["question", Scene.noun]}, {"required": ["extends"]}],
        DEFINITIONS: definitions,
    }
    return _with_kinds(whole)


def _asked_for(schema: Schema, registry: Registry, noun: str, kind: str) -> Schema:
    """The schema of one class, with the kinds by which a study asks for it."""
    asked = {"enum": [kind, *registry.qualified(noun, kind)], "type": "string"}
    required = ["kind", *schema.get("required", [])]
    return schema | {"properties": schema["properties"] | {"kind": asked}, "required": required}


def _section(section: Section, references: Mapping[Any, Schema]) -> Schema:
    """A section with kinds may leave its kind out where there is a default."""
    if CONTRACTS.get(section.contract.noun) is not section.contract:
        return references[section.contract, "validation"]
    kinds: Schema = {CONTRACT: section.contract.noun}
    if section.default_table is None and not section.of:
        return kinds
    return {"anyOf": [kinds, {"type": "object", "not": {"required": ["kind"]}}]}


def _with_kinds(schema: Any) -> Any:
    """The schema, in which a reference stands for all kinds of a contract."""
    if isinstance(schema, list):
        return [_with_kinds(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    if CONTRACT not in schema:
        return {name: _with_kinds(part) for name, part in schema.items()}
    rest = {name: part for name, part in schema.items() if name not in (CONTRACT, BY_NAME)}
    reference = {"$ref": f"#/{DEFINITIONS}/{schema[CONTRACT]}"}
    return rest | ({"anyOf": [reference, {"type": "string"}]} if schema.get(BY_NAME) else reference)
