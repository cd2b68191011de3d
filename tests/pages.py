"""The code blocks of a page in Markdown, and what it takes for each to be true.

A page is run from top to bottom in a folder of its own. What a block must do follows from its language:

    python, {code-cell}  run, in one namespace a page; a block `text` right behind it is what it prints
    toml                 a study: valid
    console              lines with `$ ` run, in the folder of the page; the other lines are what they print
    sh                   commands of nlsolve are parsed, files that a command names are there
    text, latex, mermaid words

In lines that are shown, "…" stands for any words; lines of seconds are not compared. A comment before a block says:

    <!-- file: NAME -->          the block is also written to a file, for the blocks behind it
    <!-- part of: FILE -->       the block is added to this study; to pyproject.toml: it is parsed
    <!-- not run: WHY -->        the block is compiled or parsed only
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import typer
from markdown_it import MarkdownIt
from typer.testing import CliRunner

from nlsolve.cli.app import app
from nlsolve.cli.plugins.scaffold import files_of
from nlsolve.registry.problems import StudyError
from nlsolve.study.study import Study

ROOT = Path(__file__).parent.parent
SITE = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(SITE.rglob("*.md"))]
WORDS = {"text", "latex", "mermaid"}
DIRECTIVES = {"{eval-rst}", "{toctree}", "{include}"}
"""Blocks that Sphinx builds."""

MARK = re.compile(r"<!-- (file|part of|not run): (.+?) -->\s*\Z")
VENV = ".venv/bin/"


class Untrue(AssertionError):
    """A block does not do what its page says."""


@dataclass(frozen=True)
class Block:
    """A code block: its language, and the comment before it."""

    place: str
    language: str
    text: str
    mark: str = ""
    said: str = ""
    shown: str | None = None


def blocks(text: str, name: str = "page") -> Iterator[Block]:
    """The code blocks of a page, in order. Raises Untrue for a block without a known language."""
    tokens = [token for token in MarkdownIt("commonmark").parse(text) if not token.type.endswith(("_open", "_close"))]
    for i, token in enumerate(tokens):
        if token.type not in ("fence", "code_block"):
            continue
        place = f"{name}:{(token.map or [0])[0] + 1}"
        words = token.info.split()
        language = {"{code-cell}": "python"}.get(words[0], words[0]) if words else ""
        if language not in WORDS | DIRECTIVES | {"python", "toml", "console", "sh"}:
            raise Untrue(f"{place}: a block of code begins with ``` and one of the languages, not with {token.info!r}")
        before = MARK.search(tokens[i - 1].content) if i and tokens[i - 1].type == "html_block" else None
        after = tokens[i + 1] if i + 1 < len(tokens) else None
        shown = after.content if language == "python" and after and after.info == "text" else None
        yield Block(place, language, token.content, *(before.groups() if before else ("", "")), shown)


class Session:
    """What the blocks of one page share: a folder and a namespace."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.module = folder, ModuleType(f"page_{re.sub(r'[^a-z]', '_', name.lower())}")
        for shared in ("studies", "examples", "benchmarks"):
            (folder / shared).symlink_to(ROOT / shared)
        (folder / "my_solver.py").write_text(files_of("solver", "my-solver", package=False)["my_solver.py"], "utf-8")

    def run(self, text: str, name: str) -> list[Block]:
        """All blocks of a page. Raises Untrue with the place of the first that is not true."""
        found = list(blocks(text, name))
        before = set(sys.modules)
        sys.modules[self.module.__name__] = self.module
        sys.path.insert(0, str(self.folder))
        try:
            with contextlib.chdir(self.folder):
                for block in found:
                    self.one(block)
        finally:
            sys.path.remove(str(self.folder))
            for name in {name for name in set(sys.modules) - before if self.owns(sys.modules[name])}:
                del sys.modules[name]
        return found

    def owns(self, module: ModuleType) -> bool:
        """Whether a module is the page's own, or a file in its folder."""
        return module is self.module or str(getattr(module, "__file__", "")).startswith(str(self.folder))

    def one(self, block: Block) -> None:
        """One block."""
        if block.mark == "file":
            (self.folder / block.said).write_text(block.text, encoding="utf-8")
        try:
            match block.language:
                case "python":
                    self.python(block)
                case "toml":
                    self.toml(block)
                case "console":
                    self.console(block)
                case "sh":
                    for command in commands(block.text):
                        parse(command)
        except Untrue as error:
            raise Untrue(f"{block.place}: {error}") from error

    def python(self, block: Block) -> None:
        code = compile(block.text, block.place, "exec", dont_inherit=True)
        if block.mark == "not run":
            return
        told = io.StringIO()
        try:
            with contextlib.redirect_stdout(told):
                exec(code, self.module.__dict__)
        except Exception as error:
            raise Untrue(f"{type(error).__name__}: {error}") from error
        if block.shown is not None:
            compare(told.getvalue(), block.shown)

    def toml(self, block: Block) -> None:
        try:
            table = tomllib.loads(block.text)
        except tomllib.TOMLDecodeError as error:
            raise Untrue(str(error)) from error
        if block.mark == "not run":
            return
        if block.said == "pyproject.toml":
            if not set(table) <= {"project", "build-system", "tool"}:
                raise Untrue(f"no table of pyproject.toml: {', '.join(table)}")
            return
        text = block.text
        if block.mark == "part of" and "extends" not in table:
            text = f'extends = "{block.said}"\n{text}'
        path = self.folder / "study_of_the_page.toml"
        path.write_text(text, encoding="utf-8")
        try:
            study = Study.from_toml(path)
        except StudyError as error:
            raise Untrue(str(error)) from error
        if not study.cases:
            raise Untrue("the study has no cases")

    def console(self, block: Block) -> None:
        if not block.text.startswith("$ "):
            raise Untrue("a session begins with a command, `$ …`")
        for entry in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
            command, _, shown = entry.partition("\n")
            words = shlex.split(command, comments=True)
            parse(words)
            if words[0] != "nlsolve":
                raise Untrue(f"only commands of nlsolve are run: {command}")
            result = CliRunner().invoke(app, words[1:], env={"COLUMNS": "120"})
            if isinstance(result.exception, Exception):
                raise Untrue(f"{command}: {result.exception!r}")
            if shown.strip():
                compare(result.stdout, shown)
            elif result.exit_code:
                raise Untrue(f"{command}: exit code {result.exit_code}: {result.output}")


def lines(text: str) -> list[str]:
    """The lines that are the same on every machine."""
    every = (line.rstrip() for line in text.strip("\n").splitlines())
    return [line for line in every if not line.lstrip().startswith(("seconds", "Seconds"))]


def compare(printed: str, shown: str) -> None:
    """Raises Untrue if `shown` is not what was printed."""
    pattern = "\n".join(".*".join(map(re.escape, line.split("…"))) for line in lines(shown))
    if not re.fullmatch(pattern, "\n".join(lines(printed)), flags=re.DOTALL):
        raise Untrue(f"the page shows\n{shown}\nand what is printed is\n{printed}")


def commands(text: str) -> Iterator[list[str]]:
    """The commands of a block of shell, in words."""
    for line in text.replace("\\\n", " ").splitlines():
        for command in re.split(r"&&|\|\||;", line):
            words = shlex.split(command, comments=True)
            if words:
                yield words


def parse(words: list[str]) -> None:
    """Raises Untrue for a command of nlsolve that its command line does not know, and for a file that is not there."""
    program, *arguments = words
    if program.removeprefix(VENV) == "nlsolve":
        parse_nlsolve(arguments)
    if program.removeprefix(VENV) in ("python", "nlsolve"):
        for word in arguments:
            if (
                word.startswith(("benchmarks/", "examples/", "tests/", "docs/", "studies/"))
                and not (ROOT / word).exists()
            ):
                raise Untrue(f"there is no {word}")


def parse_nlsolve(arguments: list[str]) -> None:
    if arguments in (["--version"], ["--help"]):
        return
    group: Any = typer.main.get_command(app)
    command = group.commands.get(arguments[0]) if arguments else None
    if command is None:
        raise Untrue(f"nlsolve has no command {arguments[:1]}")
    try:
        command.make_context(arguments[0], arguments[1:])
    except Exception as error:  # typer has a click of its own, so that the class of the error depends on its version
        raise Untrue(f"nlsolve {' '.join(arguments)}: {error}") from error
