"""Everything a study can name is a `Component`: a frozen, validated value with a `kind`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, ConfigDict


@dataclass(frozen=True)
class NamesAFile:
    """Marks a field that names a file."""


NAMES_A_FILE = NamesAFile()

InputFile = Annotated[str, NAMES_A_FILE]
"""The type of a field that names a file which the component reads. Its contents are part of what tells cases apart: a
case is run again when they have changed. A field of type `pathlib.Path` counts too."""


class Component(BaseModel):
    """Base of laws, scenes, discretizers, linear solvers, nonlinear solvers and rules.

    A plugin's class adds `kind: Literal["its-name"] = "its-name"` and its parameters as fields. Instances are frozen;
    `with_` gives a validated copy. Raises ValidationError for unknown fields and non-finite numbers.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        validate_default=True,
        defer_build=True,  # a study uses a few of the installed classes, and each takes a millisecond to be built
    )

    noun: ClassVar[str] = "component"
    """What the contract is called in a study file: "law", "scene", …; set by each contract."""
    incidental: ClassVar[frozenset[str]] = frozenset()
    """Fields that change nothing that a case computes, and so do not tell cases apart."""
    default_kind: ClassVar[str | None] = None
    """The kind used when a study names none, set by each contract; None when a study must name one."""

    def with_(self, **changes: Any) -> Self:
        """A copy with some fields changed, validated like a new instance. Raises ValidationError for a wrong value."""
        fields = {name: getattr(self, name) for name in type(self).model_fields}
        return type(self).model_validate({**fields, **changes})

    absent: ClassVar[str | None] = None
    """Why this kind cannot be used here, with the way out: "needs the library x: pip install …"; None when it can."""

    @classmethod
    def kind_name(cls) -> str:
        """The name by which studies ask for this class. Raises TypeError when the class declares none."""
        field = cls.model_fields.get("kind")
        if field is None or not isinstance(field.default, str):
            raise TypeError(f'{cls.__name__} must declare its name: kind: Literal["name"] = "name"')
        return field.default

    @classmethod
    def called(cls) -> str:
        """The kind, or the name of a class that declares none, for sentences."""
        field = cls.model_fields.get("kind")
        return field.default if field is not None and isinstance(field.default, str) else cls.__name__
