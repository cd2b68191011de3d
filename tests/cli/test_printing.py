"""What the commands print."""

from __future__ import annotations

import pandas as pd
import pytest

from nlsolve.cli.printing import MOST_RULED_COLUMNS, print_table
from nlsolve.show.tables import build
from nlsolve.show.tables.spec import TableSpec

WORK = TableSpec.model_validate({"name": "work", "rows": "order", "columns": "seed", "value": "iterations"})


def printed(columns: int, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """The lines of a table with one row and so many columns."""
    runs = [{"order": 3, "seed": n, "iterations": 700 + n, "status": "converged"} for n in range(columns)]
    print_table(build(WORK, pd.DataFrame(runs)))
    return capsys.readouterr().out.splitlines()


def test_a_table_wider_than_a_page_is_printed_without_rules_so_that_its_numbers_can_be_read(capsys):
    narrow, wide = printed(3, capsys), printed(MOST_RULED_COLUMNS + 1, capsys)
    assert any("│" in line for line in narrow)
    assert not any("│" in line for line in wide)
    assert wide[-1].split() == ["3", *(str(700 + n) for n in range(MOST_RULED_COLUMNS + 1))]
