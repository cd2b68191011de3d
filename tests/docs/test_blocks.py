"""Every code block of README, CONTRIBUTING and docs/ is true; and a page that is not is found."""

from __future__ import annotations

import re

import pytest
from pages import PAGES, ROOT, Session, Untrue, blocks

NAMES = [path.relative_to(ROOT).as_posix() for path in PAGES]


@pytest.fixture(autouse=True)
def tried(monkeypatch):
    """A plugin of a page is imported here without a trial in a process of its own: its block has run here already."""
    monkeypatch.setattr("nlsolve.registry.plugin_files.fault_of_file", lambda file: "")


@pytest.mark.parametrize("name", NAMES)
def test_every_block_of_a_page_is_true(name, tmp_path):
    text = (ROOT / name).read_text(encoding="utf-8")
    assert len(Session(tmp_path, name).run(text, name)) == len(re.findall(r"^ *```[a-z{]", text, flags=re.MULTILINE))


def test_there_are_many_blocks_and_few_that_are_not_run():
    every = [block for name in NAMES for block in blocks((ROOT / name).read_text(encoding="utf-8"), name)]
    assert sum(block.language == "python" for block in every) > 20
    assert sum(block.language == "toml" for block in every) > 20
    assert sum(block.language == "console" for block in every) >= 3
    not_run = [block.place.partition(":")[0] for block in every if block.mark == "not run"]
    assert sorted(not_run) == ["docs/clusters.md"]  # a cluster


STUDY = 'question = "Which root?"\n[scene]\nkind = "published"\nproblem = "boggs"\n'
PLANTED = {
    "an exception": ("```python\n1 / 0\n```", "page:1: ZeroDivisionError: division by zero"),
    "a name of another page": ("```python\nprint(np)\n```", "NameError: name 'np' is not defined"),
    "another output": ("```python\nprint(1)\n```\n\n```text\n2\n```", "what is printed is\n1"),
    "Python that does not parse": ("<!-- not run: why -->\n```python\n1 +\n```", "invalid syntax"),
    "an unknown kind": (
        f'```toml\n{STUDY}[solver]\nkind = "newtom"\n```',
        "newton",
    ),
    "half a study": ('```toml\n[solver]\nkind = "newton"\n```', "question"),
    "a part of a study with a wrong key": (
        "<!-- part of: studies/first.toml -->\n```toml\n[stop]\ntolerence = 1e-8\n```",
        "tolerance",
    ),
    "TOML that does not parse": ("<!-- not run: why -->\n```toml\na = \n```", "Invalid value"),
    "a plugin that is not there": (f'```toml\nplugins = ["./other.py"]\n{STUDY}```', "other.py"),
    "another table of pyproject.toml": ("<!-- part of: pyproject.toml -->\n```toml\n[projekt]\n```", "projekt"),
    "a command that is not there": ("```sh\nnlsolve rum study.toml\n```", "no command"),
    "an option that is not there": ("```sh\nnlsolve run study.toml --fast\n```", "--fast"),
    "a command without its study": ("```sh\n.venv/bin/nlsolve run\n```", "Missing parameter: study"),
    "too many words": ("```sh\ncd x && nlsolve validate a.toml b.toml\n```", "unexpected extra argument"),
    "a script that is not there": ("```sh\npython benchmarks/nothing.py 4\n```", "there is no benchmarks/nothing.py"),
    "a session with another output": (
        "```console\n$ nlsolve --version\nnlsolve 99\n```",
        "what is printed is",
    ),
    "a session that fails": ("```console\n$ nlsolve validate nothing.toml\n```", "exit code 2"),
    "a session of another program": ("```console\n$ ls\n```", "only commands of nlsolve"),
    "a session without a command": ("```console\nls\n```", "begins with a command"),
    "an indented block": ("text\n\n    code\n", "page:3: a block of code begins with"),
    "a block without a language": ("```\ncode\n```", "one of the languages"),
    "a block in an unknown language": ("- x\n\n  ```pyton\n  code\n  ```", "pyton"),
}


@pytest.mark.parametrize("fault", PLANTED)
def test_a_page_that_is_not_true_is_found(fault, tmp_path):
    page, said = PLANTED[fault]
    with pytest.raises((Untrue, SyntaxError)) as raised:
        Session(tmp_path, "planted").run(page, "page")
    assert said in str(raised.value)


TRUE = f"""\
<!-- file: study.toml -->
```toml
{STUDY}```

<!-- part of: study.toml -->
```toml
[stop]
tolerance = 1e-4
```

```python
import nlsolve

results = nlsolve.run("study.toml")
```

```python
print(results.runs["status"][0], "\\nseconds 1")
```

```text
conv…
seconds 2
```

```console
$ nlsolve validate study.toml   # a comment
study.toml is valid: 1 case. Which …
$ nlsolve run study.toml
```

<!-- not run: nobody has it -->
```python
import nothing
```

```sh
nlsolve run study.toml \\
    --set solver.order=20 --only "solver.kind=anm"
```
"""


def test_a_page_that_is_true_passes(tmp_path):
    found = Session(tmp_path, "true").run(TRUE, "page")
    assert [block.language for block in found].count("python") == 3
    assert (tmp_path / "results" / "study" / "runs.parquet").exists()
