"""The results that the tests of figures draw."""

from __future__ import annotations

import pandas as pd
import pytest
from pictures import results


@pytest.fixture(scope="module")
def frames() -> dict[str, pd.DataFrame]:
    return results()
