"""Study files with one mistake each: exit code 2, one sentence with file and line, and no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from nlsolve.cli.app import app

BASE = """\
question = "Does it run?"
[scene]
kind = "published"
problem = "boggs"
[solver]
kind = "newton"
"""
SWEEP = '[[sweep]]\ngrid = { "solver.kind" = ["newton", "anm"] }\n'
GRID = "[[sweep]]\ngrid = "
TABLE = '[[table]]\nname = "t"\nrows = "solver.kind"\nvalue = "tangents"\n'


def changed(old: str, new: str) -> str:
    """The study with a piece of its text replaced."""
    assert old in BASE
    return BASE.replace(old, new)


FILES: dict[str, tuple[str | bytes, str]] = {
    "empty": ("", ": question: required, and missing"),
    "only a question": ('question = "q"\n', ": scene: required, and missing"),
    "an empty question": (changed("Does it run?", ""), ", line 1: question = '': should have at least 1 character"),
    "no question": (changed('question = "Does it run?"\n', ""), ": question: required, and missing"),
    "a question that is a number": (changed('"Does it run?"', "3"), ", line 1: question = 3: should be a valid string"),
    "an open bracket": (
        "[scene\n",
        ", line 1, column 7: not valid TOML: Expected ']' at the end of a table declaration",
    ),
    "a table twice": (
        BASE + '[solver]\nkind = "anm"\n',
        ", line 7, column 8: not valid TOML: Cannot declare ('solver',) twice",
    ),
    "a key twice": (
        changed('problem = "boggs"', 'problem = "boggs"\nproblem = "scalar"'),
        ", line 5, column 19: not valid TOML: Cannot overwrite a value",
    ),
    "a null byte": (BASE + "\x00", ", line 7, column 1: not valid TOML: Invalid statement"),
    "no value": (changed('kind = "newton"', "kind ="), ", line 6, column 7: not valid TOML: Invalid value"),
    "an open string": (changed('"newton"', '"newton'), ", line 6, column 15: not valid TOML: Illegal character '\\n'"),
    "a word without quotes": (changed('"newton"', "newton"), ", line 6, column 8: not valid TOML: Invalid value"),
    "utf-16": (BASE.encode("utf-16"), ", line 1: the study is not UTF-8 text: invalid start byte"),
    "latin-1": (
        BASE.replace("Does it run?", "L\xe4uft es?").encode("latin-1"),
        ", line 1: the study is not UTF-8 text: invalid continuation byte",
    ),
    "latin-1 further down": (
        (BASE + "# \xe4\n").encode("latin-1"),
        ", line 7: the study is not UTF-8 text: invalid continuation byte",
    ),
    "no scene": (changed('[scene]\nkind = "published"\nproblem = "boggs"\n', ""), ": scene: required, and missing"),
    "a misspelt section": (
        changed("[solver]", "[sovler]"),
        ", line 5: sovler = {'kind': 'newton'}: no such section; did you mean 'solver'?",
    ),
    "a section that is a word": (
        changed('[solver]\nkind = "newton"\n', "").replace("[scene]", 'solver = "newton"\n[scene]'),
        ", line 2: solver = 'newton': should be a table with a kind, like { kind = \"…\" }, or an instance",
    ),
    "a section that is a list": (
        changed("[solver]", "[[solver]]"),
        ", line 5: solver = [{'kind': 'newton'}]: should be a table with a kind, like { kind = \"…\" },",
    ),
    "a misspelt kind": (
        changed('"newton"', '"newtn"'),
        ", line 6: solver.kind = 'newtn': no such solver; did you mean 'newton'?",
    ),
    "a kind that is a number": (changed('"newton"', "3"), ", line 6: solver.kind = 3: no such solver;"),
    "a kind that is a list": (
        changed('"newton"', '["newton"]'),
        ", line 6: solver.kind = ['newton']: no such solver; did you mean 'newton'?",
    ),
    "a kind of a package that has it not": (
        changed('"newton"', '"nobody:newton"'),
        ", line 6: solver.kind = 'nobody:newton': 'nobody' offers no solver 'newton'; it is offered as",
    ),
    "a kind of an older version": (
        changed('"published"', '"system"'),
        ", line 3: scene.kind = 'system': this kind is called 'published' now",
    ),
    "a misspelt field": (
        changed("problem =", "problm ="),
        ", line 4: scene.problm = 'boggs': no such field; did you mean 'problem'?",
    ),
    "a field too many": (
        changed('kind = "newton"', 'kind = "newton"\norder = 20'),
        ", line 7: solver.order = 20: no such field; there are 'kind', 'globalization'",
    ),
    "a date": (
        changed('"boggs"', "1979-05-27"),
        ", line 4: scene.problem = datetime.date(1979, 5, 27): should be a valid string",
    ),
    "a fraction for an integer": (
        changed('"newton"', '"anm"\norder = 20.5'),
        ", line 7: solver.order = 20.5: should be a valid integer, got a number with a fractional part",
    ),
    "a word for a number": (
        changed('"newton"', '"anm"\norder = "many"'),
        ", line 7: solver.order = 'many': should be a valid integer, unable to parse string as an",
    ),
    "a boolean for an integer": (
        changed('"newton"', '"anm"\norder = true'),
        ", line 7: solver.order = True: should be greater than or equal to 2",
    ),
    "too small": (
        changed('"newton"', '"anm"\norder = 1'),
        ", line 7: solver.order = 1: should be greater than or equal to 2",
    ),
    "nan": (BASE + "[stop]\ntolerance = nan\n", ", line 8: stop.tolerance = nan: should be a finite number"),
    "infinity": (BASE + "[stop]\ntolerance = inf\n", ", line 8: stop.tolerance = inf: should be a finite number"),
    "a huge integer": (
        BASE + "[budget]\niterations = 100000000000000000000\n",
        ", line 8: budget.iterations = 100000000000000000000: should be an integer of at most",
    ),
    "a negative budget": (
        BASE + "[budget]\niterations = -1\n",
        ", line 8: budget.iterations = -1: should be greater than 0",
    ),
    "a quoted dotted key at the top": (
        changed('[solver]\nkind = "newton"\n', "").replace("[scene]", '"solver.kind" = "newton"\n[scene]'),
        ", line 2: solver.kind = 'newton': no such section; did you mean 'solver'?",
    ),
    "a misspelt kind inside": (
        changed('kind = "newton"', 'kind = "newton"\nglobalization = { kind = "nothing" }'),
        ", line 7: solver.globalization.kind = 'nothing': no such globalization;",
    ),
    "a misspelt field inside": (
        changed('kind = "newton"', 'kind = "newton"\nglobalization = { kind = "cubic", trils = 3 }'),
        ", line 7: solver.globalization.trils = 3: no such field; did you mean 'trials'?",
    ),
    "a word where a table belongs": (
        changed('kind = "newton"', 'kind = "newton"\nglobalization = "cubic"'),
        ", line 7: solver.globalization = 'cubic': should be a table with a kind, like { kind = \"…\" },",
    ),
    "a claim that nobody makes": (
        BASE + '[stop]\nkind = "claim"\n',
        ", line 8: stop.kind = 'claim': the solver 'newton' never claims a solution; use residual or",
    ),
    "a section of other scenes": (
        BASE + '[law]\nkind = "power-law"\n',
        ", line 7: law: the scene 'published' has no such section: leave it out",
    ),
    "an empty sweep": (BASE + "[[sweep]]\n", ", line 7: sweep[0] = {}: a sweep has one of grid, zip, each and repeat"),
    "an empty grid": (BASE + GRID + "{ }\n", ", line 7: sweep[0] = {'grid': {}}: nothing is swept"),
    "a grid without values": (
        BASE + GRID + '{ "stop.tolerance" = [] }\n',
        ", line 7: sweep[0] = {'grid': {'stop.tolerance': []}}: 'stop.tolerance' has no values",
    ),
    "a grid of one number": (
        BASE + GRID + '{ "stop.tolerance" = 1e-8 }\n',
        ", line 8: sweep[0].grid.stop.tolerance = 1e-08: should be a list",
    ),
    "an empty each": (BASE + "[[sweep]]\neach = []\n", ", line 7: sweep[0] = {'each': []}: nothing is swept"),
    "a sweep that is a table": (
        BASE + '[sweep]\ngrid = { "stop.tolerance" = [1e-8] }\n',
        ", line 7: sweep = {'grid': {'stop.tolerance': [1e-08]}}: should be a list",
    ),
    "two ways to sweep": (
        BASE + GRID + '{ "stop.tolerance" = [1e-8] }\nzip = { "budget.iterations" = [5] }\n',
        ", line 7: sweep[0]: a sweep has one of grid, zip, each and repeat",
    ),
    "swept twice": (
        BASE + GRID + '{ "stop.tolerance" = [1e-8] }\n' * 1 + GRID + '{ "stop.tolerance" = [1e-7] }\n',
        ", line 10: stop.tolerance = []: swept twice",
    ),
    "a misspelt parameter swept": (
        BASE + GRID + '{ "stop.tolerence" = [1e-8] }\n',
        ", line 8: stop.tolerence = 1e-08: no such field; did you mean 'tolerance'?",
    ),
    "a misspelt section swept": (
        BASE + GRID + '{ "stp.tolerance" = [1e-8] }\n',
        ", line 8: stp.tolerance = []: not a parameter; did you mean 'stop'?",
    ),
    "a wrong value swept": (
        BASE + GRID + '{ "stop.tolerance" = [1e-8, -1.0] }\n',
        ", line 8: stop.tolerance = -1.0: should be greater than 0",
    ),
    "lists of two lengths": (
        BASE + '[[sweep]]\nzip = { "stop.tolerance" = [1e-8], "budget.iterations" = [5, 6] }\n',
        ", line 7: sweep[0]: zip needs lists of one length; 'stop.tolerance' has 1, 'budget.iterations'",
    ),
    "a setting without a name": (
        BASE + '[[sweep]]\neach = [{ "stop.tolerance" = 1e-6 }]\n',
        ", line 8: sweep[0].each[0].name: required, and missing",
    ),
    "two settings of one name": (
        BASE + '[[sweep]]\neach = [{ name = "a" }, { name = "a", "stop.tolerance" = 1e-6 }]\n',
        ", line 7: sweep[0]: 2 settings are called 'a'; give each its own name",
    ),
    "two settings of one case": (
        BASE + '[[sweep]]\neach = [{ name = "a" }, { name = "b", "stop.tolerance" = 1e-8 }]\n',
        ", line 8: sweep[0].each[1]: 'a' and 'b' are one and the same case: change one of them, or drop",
    ),
    "a generator with too few numbers": (
        BASE + GRID + '{ "stop.tolerance" = { logspace = [1e-8, 1e-2] } }\n',
        ", line 8: sweep[0].grid.stop.tolerance = {'logspace': [1e-08, 0.01]}: logspace needs [first,",
    ),
    "a repetition without seeds": (
        BASE + "[[sweep]]\nrepeat = { times = 3 }\n",
        ", line 8: sweep[0].repeat.seeds: required, and missing",
    ),
    "an exclusion without a reason": (
        BASE + SWEEP + '[[exclude]]\nwhere = { "solver.kind" = "anm" }\n',
        ", line 9: exclude[0].reason: required, and missing",
    ),
    "an exclusion of nothing": (
        BASE + SWEEP + '[[exclude]]\nwhere = { "solver.kind" = "picard" }\nreason = "r"\n',
        ", line 10: exclude[0].where: no case has these values, or an earlier rule leaves it out",
    ),
    "everything excluded": (
        BASE + '[[exclude]]\nwhere = { "solver.kind" = "newton" }\nreason = "r"\n',
        ", line 7: exclude: no case is left",
    ),
    "a table without a name": (
        BASE + '[[table]]\nrows = "solver.kind"\nvalue = "tangents"\n',
        ", line 7: table[0].name: required, and missing",
    ),
    "a table without rows": (
        BASE + '[[table]]\nname = "t"\nvalue = "tangents"\n',
        ", line 7: table[0] = {'name': 't', 'value': 'tangents'}: rows is required, and missing: a",
    ),
    "a table of a column that is not there": (
        BASE + '[[table]]\nname = "t"\nrows = "solver.kind"\nvalue = "tangnts"\n',
        ", line 10: table[0].value = 'tangnts': no such column of the results; did you mean 'tangents'?",
    ),
    "a table with two runs in a cell": (
        BASE + SWEEP + '[[table]]\nname = "t"\nrows = "scene.kind"\nvalue = "tangents"\n',
        ", line 11: table[0].rows = ['scene.kind']: several runs land in the cell scene.kind =",
    ),
    "a table's name that is a path": (
        BASE + '[[table]]\nname = "../t"\nrows = "solver.kind"\nvalue = "tangents"\n',
        ", line 8: table[0].name = '../t': should match pattern '^[A-Za-z0-9][A-Za-z0-9_-]*$'",
    ),
    "a name of 300 letters": (
        BASE + '[[table]]\nname = "' + "t" * 300 + '"\nrows = "solver.kind"\nvalue = "tangents"\n',
        ", line 8: table[0].name: should have at most 100 characters",
    ),
    "two tables of one name": (
        BASE + TABLE * 2,
        ", line 12: table[1].name = 't': another table has this name, perhaps in other letter case; its",
    ),
    "two tables of one name but for its case": (
        BASE + TABLE + TABLE.replace('"t"', '"T"'),
        ", line 12: table[1].name = 'T': another table has this name, perhaps in other letter case; its",
    ),
    "a table whose file another's comparison would replace": (
        BASE + TABLE + 'paper = { source = "s", values = [[1]] }\n' + TABLE.replace('"t"', '"t-paper"'),
        ", line 13: table[1].name = 't-paper': another table has this name, perhaps in other letter case; its",
    ),
    "a table whose file is the preamble's": (
        BASE + TABLE.replace('"t"', '"Preamble"'),
        ", line 8: table[0].name = 'Preamble': the file preamble.tex beside the tables has this name; choose another",
    ),
    "a table with a word on a column that it does not have": (
        BASE + TABLE + "digits = { secnds = 2 }\n",
        ", line 11: table[0].digits = 'secnds': the table has no such column; there are 'solver.kind', 'tangents'",
    ),
    "a figure of an unknown kind": (
        BASE + '[[figure]]\nname = "f"\nkind = "pie"\n',
        ", line 9: figure[0].kind = 'pie': should be 'line', 'map', 'trade', 'crossover',",
    ),
    "a figure without a kind": (BASE + '[[figure]]\nname = "f"\n', ", line 7: figure[0].kind: required, and missing"),
    "a figure of a column that is not there": (
        BASE + '[[figure]]\nname = "f"\nkind = "map"\nx = "solver.kind"\ny = "solver.knd"\n',
        ", line 11: figure[0].y = 'solver.knd': no such column of the results; did you mean",
    ),
    "an expectation of nothing": (
        BASE + '[[expect]]\ncolumn = "tangents"\n',
        ", line 7: expect[0] = {'column': 'tangents'}: says nothing: give at_most, at_least, equals or",
    ),
    "an expectation of a column that is not there": (
        BASE + '[[expect]]\ncolumn = "tangnts"\nat_most = 3\n',
        ", line 8: expect[0].column = 'tangnts': no such column of the results; did you mean 'tangents'?",
    ),
    "an expectation of a table that is not there": (
        BASE + '[[expect]]\ncolumn = "tangents"\ntable = "t"\nat_most = 3\n',
        ", line 9: expect[0].table = 't': no such table; there are none",
    ),
    "a circle": (
        'extends = "study.toml"\n' + BASE,
        ", line 1: extends = 'study.toml': studies cannot extend one another in a circle: study.toml",
    ),
    "a base that is not there": (
        'extends = "nowhere.toml"\n' + BASE,
        ", line 1: extends = 'nowhere.toml': there is no file nowhere.toml",
    ),
    "a plugin that is not there": (
        'plugins = ["nowhere.py"]\n' + BASE,
        ", line 1: plugins[0]: the plugin nowhere.py cannot be read: No such file or directory",
    ),
    "plugins that are one word": ('plugins = "half.py"\n' + BASE, ", line 1: plugins = 'half.py': should be a list"),
    "a reference that is a word": (
        'reference = "newton"\n' + BASE,
        ", line 1: reference = 'newton': should be a table",
    ),
    "timing that is a number": ("timing = 3\n" + BASE, ", line 1: timing = 3: should be a table"),
    "no rounds": (BASE + "[timing]\nrounds = 0\n", ", line 8: timing.rounds = 0: should be greater than 0"),
    "a lane that there is not": (
        BASE + '[timing]\nlane = "fast"\n',
        ", line 8: timing.lane = 'fast': should be 'shared' or 'exclusive'",
    ),
    "more of the fewest rounds than of the most": (
        BASE + '[timing]\nlane = "exclusive"\nrounds = 31\n',
        ", line 7: timing = {'lane': 'exclusive', 'rounds': 31}: most_rounds = 30 is less than rounds = 31, the fewest",
    ),
    "no precision": (
        BASE + '[timing]\nlane = "exclusive"\nprecision = 0\n',
        ", line 9: timing.precision = 0: should be greater than 0",
    ),
    "a wrong value in the quick form": (
        BASE + '[quick]\n"stop.tolerance" = -1.0\n',
        ", line 8: stop.tolerance = -1.0: should be greater than 0",
    ),
    "a quick form that is a word": ('quick = "yes"\n' + BASE, ", line 1: quick = 'yes': should be a table"),
}
"""Name -> text of the file, and how its sentence begins behind the file's name."""

KEPT = {
    "a mark before the first byte": b"\xef\xbb\xbf" + BASE.encode(),
    "lines that end as on Windows": BASE.replace("\n", "\r\n").encode(),
    "lines that end as on old Macs": BASE.replace("\n", "\r").encode(),
    "tabs": BASE.replace(" = ", "\t=\t").encode(),
    "other alphabets": BASE.replace("Does it run?", "Läuft es? λ/μ → ∞, 中文, 🙂").encode(),
    "comments": BASE.replace('"newton"', '"newton" # μ, "quoted", [x]').encode(),
    "dotted keys": b'question = "q"\nscene.kind = "published"\nscene.problem = "boggs"\nsolver.kind = "newton"\n',
    "lists over several lines": f'{BASE}{GRID}{{ "scene.problem" = [\n "boggs", # one\n "scalar",\n] }}\n'.encode(),
    "a value that is swept twice": f'{BASE}{GRID}{{ "stop.tolerance" = [1e-8, 1e-8, 1.0e-8] }}\n'.encode(),
    "whole numbers and fractions": f'{BASE}{GRID}{{ "scene.factor" = [1, 1.0, 2] }}\n'.encode(),
    "a fraction that is whole": BASE.replace('"newton"', '"anm"\norder = 20.0').encode(),
    "a setting with a long name of two lines": (
        f'{BASE}[[sweep]]\neach = [{{ name = """two\n{"x" * 5000}""" }}, {{ name = "y", "stop.tolerance" = 1e-6 }}]\n'
    ).encode(),
    "a quick form alone": f'{BASE}[quick]\n"stop.tolerance" = 1e-3\n'.encode(),
    "a question of several lines": BASE.replace('"Does it run?"', '"""\nDoes it\nrun? \\"yes\\" """').encode(),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_there_are_sixty() -> None:
    assert len(FILES) >= 60
    assert len({sentence for _, sentence in FILES.values()}) > 55


@pytest.mark.parametrize("name", FILES)
def test_a_broken_file_is_answered_in_one_sentence(name: str) -> None:
    text, sentence = FILES[name]
    Path("study.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    result = CliRunner().invoke(app, ["validate", "study.toml"])
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"study.toml{sentence}")


@pytest.mark.parametrize("name", KEPT)
def test_what_editors_do_is_taken(name: str) -> None:
    Path("study.toml").write_bytes(KEPT[name])
    result = CliRunner().invoke(app, ["validate", "study.toml"])
    assert (result.exit_code, result.stderr) == (0, "")


def test_a_folder_and_an_absent_file() -> None:
    for name, reason in (("folder", "Is a directory"), ("nowhere.toml", "No such file or directory")):
        Path("folder").mkdir(exist_ok=True)
        result = CliRunner().invoke(app, ["validate", name])
        assert (result.exit_code, result.stderr) == (2, f"{name}: the study cannot be read: {reason}\n")
