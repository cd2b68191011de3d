"""Help texts: all there, nothing in brackets eaten as markup; and the completion of shells."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest
import typer
from rich.text import Text
from typer.testing import CliRunner

from nlsolve.cli.app import app

COMMANDS = sorted(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_argument_and_option_has_a_help_that_is_shown_whole(command: str):
    found = typer.main.get_command(app).commands[command]  # type: ignore[attr-defined]
    shown = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "300", "TERMINAL_WIDTH": "300"})
    assert shown.exit_code == 0
    words = " ".join(re.sub("[│╭╮╰╯─]", " ", shown.stdout).split())
    texts = [paragraph for paragraph in found.help.split("\n\n")]
    texts += [parameter.help for parameter in found.params if parameter.name != "help"]
    for text in texts:
        assert text, f"{command}: an option without help"
        plain = " ".join(text.replace("\\[", "[").split())
        assert Text.from_markup(text).plain.split() == plain.split(), "brackets are markup: write \\["
        assert plain in words
    assert found.help.endswith("."), "the help of a command is a sentence"


def as_program(**environment: str) -> str:
    """What `nlsolve` prints where a shell calls it with these variables."""
    program = [sys.executable, "-c", "import sys; sys.argv = ['nlsolve']; from nlsolve.cli.main import main; main()"]
    told = {**os.environ, **environment}
    return subprocess.run(program, env=told, capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("nlsolve exa", ["examples"]),
        ("nlsolve examples paper/tab", ["paper/table-1", "paper/table-2"]),
        ("nlsolve new glo", ["globalization"]),
        ("nlsolve run --quic", ["--quick"]),
    ],
)
def test_a_shell_completes_commands_options_and_names(line: str, words: list[str]):
    last = str(line.count(" "))
    assert as_program(_NLSOLVE_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=last).split() == words


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_a_shell_is_told_how_to_complete(shell: str):
    assert f"complete_{shell}" in as_program(_NLSOLVE_COMPLETE=f"source_{shell}")
