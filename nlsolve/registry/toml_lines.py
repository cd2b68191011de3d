"""The line of every key of a TOML file, which `tomllib` does not give."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping

Place = tuple[str | int, ...]
"""Keys and list positions from the top of a document: ("sweep", 0, "grid", "solver.order")."""

TOKEN = re.compile(
    r"""(?P<blank>[ \t\r]+|\#[^\n]*)
      | (?P<newline>\n)
      | (?P<string>\"{3}(?:\\.|[^\\])*?\"{3,5} | '{3}.*?'{3,5} | "(?:\\.|[^"\\\n])*" | '[^'\n]*')
      | (?P<mark>[\[\]{}=,.])
      | (?P<word>[^\s\#\[\]{}=,."']+)""",
    re.VERBOSE | re.DOTALL,
)


def lines_of(text: str) -> dict[Place, int]:
    """Line number, from 1, of every key and list entry of a document that `tomllib` accepts."""
    return _Scanner(text).lines


def nearest_place(lines: Mapping[Place, int], place: Place) -> Place | None:
    """A place itself, or the closest enclosing place that is written in the file; None when there is none."""
    return next((place[:length] for length in range(len(place), 0, -1) if place[:length] in lines), None)


class _Scanner:
    """Recursive descent over tokens; the grammar is lenient because `tomllib` has accepted the text before."""

    def __init__(self, text: str) -> None:
        self.lines: dict[Place, int] = {}
        self._tokens = list(_tokens(text))
        self._next = 0
        self._counts: dict[Place, int] = {}
        base: Place = ()
        while self._peek():
            if self._skip("\n"):
                continue
            if self._peek() == "[":
                base = self._header()
            else:
                self._pair(base)

    def _peek(self) -> str:
        return self._tokens[self._next][0] if self._next < len(self._tokens) else ""

    def _line(self) -> int:
        return self._tokens[self._next][1]

    def _skip(self, text: str) -> bool:
        """Step over the next token if it is `text`, and say whether it was."""
        found = self._peek() == text
        self._next += found
        return found

    def _header(self) -> Place:
        """[a.b] or [[a.b]], resolved to the last entry of every list of tables on the way."""
        line = self._line()
        self._skip("[")
        repeated = self._skip("[")
        place: Place = ()
        keys = self._keys()
        for depth, key in enumerate(keys):
            place = (*place, key)
            if repeated and depth == len(keys) - 1:
                self._counts[place] = self._counts.get(place, 0) + 1
            self.lines.setdefault(place, line)
            if place in self._counts:
                place = (*place, self._counts[place] - 1)
        self.lines.setdefault(place, line)
        self._skip("]")
        self._skip("]")
        return place

    def _keys(self) -> list[str]:
        """The parts of a dotted key such as a.b."c d"."""
        keys = []
        while True:
            text = self._peek()
            self._next += 1
            keys.append(tomllib.loads(f"key = {text}")["key"] if text[0] in "\"'" else text)
            if not self._skip("."):
                return keys

    def _pair(self, base: Place) -> None:
        """Read one line `key = value`."""
        line = self._line()
        place = base
        for key in self._keys():
            place = (*place, key)
            self.lines.setdefault(place, line)
        self._skip("=")
        self._value(place)

    def _value(self, place: Place) -> None:
        if self._skip("["):
            self._items(place)
        elif self._skip("{"):
            while not self._skip("}"):
                if not (self._skip(",") or self._skip("\n")):
                    self._pair(place)
        else:
            while self._peek() not in ("", "\n", ",", "]", "}"):
                self._next += 1

    def _items(self, place: Place) -> None:
        index = 0
        while not self._skip("]"):
            if self._skip(",") or self._skip("\n"):
                continue
            self.lines[(*place, index)] = self._line()
            self._value((*place, index))
            index += 1


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    line = 1
    for match in TOKEN.finditer(text):
        if match.lastgroup != "blank":
            yield match.group(), line
        line += match.group().count("\n")
