"""The classes that are offered under one noun and kind, and which of them a kind means."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from nlsolve.contracts.component import Component
from nlsolve.registry.classes import QUALIFIED, checked

FIRST_PARTY = "nlsolve"
"""The package whose kinds are meant where a study asks for one that other packages offer too."""


@dataclass(frozen=True)
class Offer:
    """A class that a package or a file offers.

    provider : the package, or the stem of the file, that offers the class."""

    cls: type[Component]
    source: str
    provider: str

    @property
    def name(self) -> str:
        """The qualified kind."""
        return f"{self.provider}{QUALIFIED}{self.cls.kind_name()}"


class Offers:
    """Component classes by noun and kind."""

    def __init__(self) -> None:
        self._offers: dict[tuple[str, str], list[Offer]] = {}
        self._usable: dict[str, dict[str, type[Component]]] = {}

    def _set_apart(self) -> None:
        """What this one takes up from now on, no other one has, be it a copy of another."""
        self._offers = {name: list(offers) for name, offers in self._offers.items()}
        self._usable = {}

    def offer(self, classes: Iterable[type[Component]], source: str) -> None:
        """Take up component classes. Raises TypeError for a class that no study can ask for."""
        for cls in map(checked, classes):
            offer = Offer(cls, source, source.partition(" ")[0])
            others = self._offers.setdefault((cls.noun, cls.kind_name()), [])
            if offer not in others:
                others.append(offer)
        self._usable.clear()

    def classes(self, noun: str) -> Mapping[str, type[Component]]:
        """The usable classes of one noun, by kind."""
        if noun not in self._usable:
            kinds = sorted(kind for offered_noun, kind in self._offers if offered_noun == noun)
            chosen = {kind: self._chosen(noun, kind) for kind in kinds}
            self._usable[noun] = {
                kind: offers[0].cls
                for kind, offers in chosen.items()
                if len(offers) == 1 and offers[0].cls.absent is None
            }
        return self._usable[noun]

    def offered(self, noun: str, absent_too: bool = False) -> dict[str, type[Component]]:
        """The classes of one noun by the kind that asks for each, qualified where the kind alone means another class.

        absent_too : whether classes whose libraries are not installed are among them.
        """
        found = {}
        for row_noun, kind in sorted(self._offers):
            for offer in self._offers[row_noun, kind] if row_noun == noun else ():
                name = kind if self._chosen(noun, kind) == [offer] else offer.name
                if self._chosen(noun, name) == [offer] and (absent_too or offer.cls.absent is None):
                    found[name] = offer.cls
        return found

    def qualified(self, noun: str, kind: str) -> list[str]:
        """The qualified kind of the class that an unqualified kind means; of a qualified one there is no other."""
        return [offer.name for offer in self._chosen(noun, kind)] if QUALIFIED not in kind else []

    def class_called(self, noun: str, kind: str) -> type[Component] | None:
        """The usable class of a kind, qualified or not; None when there is none."""
        if QUALIFIED not in kind:
            return self.classes(noun).get(kind)
        offers = self._chosen(noun, kind)
        return offers[0].cls if len(offers) == 1 and offers[0].cls.absent is None else None

    def kind_of(self, component: Component) -> str | None:
        """The kind by which a study asks for a component's own class, qualified where the kind alone means another
        class; None when no plugin offers the class."""
        cls, kind = type(component), component.kind_name()
        if self.classes(component.noun).get(kind) is cls:
            return kind
        return next((offer.name for offer in self._offers.get((component.noun, kind), []) if offer.cls is cls), None)

    def _chosen(self, noun: str, kind: str) -> list[Offer]:
        """The offers that a kind stands for: those of the package that it names, or else the first-party ones among
        several."""
        provider, colon, bare = kind.rpartition(QUALIFIED)
        offers = self._offers.get((noun, bare), [])
        if colon:
            return [offer for offer in offers if offer.provider == provider]
        own = [offer for offer in offers if offer.provider == FIRST_PARTY]
        return own if own and len(offers) > 1 else offers
