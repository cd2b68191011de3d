"""The report in a real browser: no script error, no request, and a click on a heading sorts its table."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from pictures import results, spec_of

from nlsolve.results.frames import Frames
from nlsolve.show.figures import write
from nlsolve.show.provenance import Provenance
from nlsolve.show.report import Picture, write_report

BAD = '"><script>document.title="taken"</script><img src=x onerror=document.title="taken"> & \'<b>'
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

WATCH = """<script>
window.seen = { errors: [], refused: [] };
const remember = (event) => window.seen.errors.push(String(event.message || event.target.outerHTML));
window.addEventListener("error", remember, true);
window.addEventListener("securitypolicyviolation", (event) => window.seen.refused.push(event.blockedURI));
</script>
"""
CLICK = """<script>
window.addEventListener("load", () => {
  const columns = (table, place) => Array.from(table.tBodies[0].rows, (row) => row.cells[place].textContent);
  const clicked = [];
  for (const table of document.querySelectorAll("table.sorts")) {
    for (const heading of table.tHead.rows[0].cells) {
      const place = heading.cellIndex, before = columns(table, place);
      heading.querySelector("button").click();
      const once = columns(table, place), up = heading.getAttribute("aria-sort");
      heading.querySelector("button").click();
      const twice = columns(table, place), down = heading.getAttribute("aria-sort");
      clicked.push({ heading: heading.textContent, before, once, twice, up, down });
    }
  }
  const pictures = Array.from(document.images, (image) => image.naturalWidth);
  const loaded = performance.getEntriesByType("resource").map((entry) => entry.name);
  const told = { ...window.seen, clicked, pictures, loaded, title: document.title };
  const place = document.createElement("pre");
  place.id = "told";
  place.textContent = JSON.stringify(told);
  document.body.append(place);
});
</script>
"""


def browser() -> str:
    """A Chromium; skips the test where none is installed."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no Chromium is installed")
    return found


def opened(page: Path, folder: Path) -> tuple[str, list[str]]:
    """What becomes of a page in the browser, and what stands on its console."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=5000"]
    profile = f"--user-data-dir={folder / 'profile'}"
    told = subprocess.run(
        [browser(), *options, profile, "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return told.stdout, [line for line in told.stderr.splitlines() if "CONSOLE" in line]


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with everything in it, whose every text is hostile."""
    folder = tmp_path_factory.mktemp("report")
    frames = results()
    runs = frames["runs"].assign(
        variant=[f"{BAD} {n}" for n in range(4)],
        message=BAD,
        doubt=["", BAD, "", ""],
        seconds=[4.0, 0.5, 12.0, 1.0],
        seconds_factorization=[3.0, 0.25, 10.0, 0.5],
        environment="e1",
        **{"audit.resolution": [0.5, 14.0, 2.0, np.nan]},
    )
    spec = spec_of(
        kind="cloud", where={"case": "b"}, animation="gif", formats="svg", caption=BAD, title="picture", resolution=60
    )
    written = write(spec, Frames(**frames), folder / "figures")
    files = tuple(f"figures/{path.name}" for path in written.paths)
    picture = Picture(spec.name, spec.caption, written.png, written.inches, written.moving, files)
    table = pd.DataFrame(
        {
            "order": ["10", "9", "100", "", "budget spent"],
            "residual": ["4.7e-10", "3e-8", "-1", "1.5 (2) within", "0.2"],
        }
    )
    return write_report(
        folder,
        f"What? {BAD}",
        {f"table {BAD}": table},
        [picture],
        runs,
        {"e1": {"numpy": BAD}},
        excluded=[(BAD, BAD)],
        notes={f"table {BAD}": [BAD]},
        provenance=Provenance(BAD, f"nlsolve run {BAD}", "1", "today"),
        remarks=[BAD],
    )


@dataclass(frozen=True)
class Seen:
    """What the scripts of the test have seen of a page, and what stood on its console."""

    told: dict[str, Any]
    console: list[str]


@pytest.fixture(scope="module")
def seen(page: Path, tmp_path_factory: pytest.TempPathFactory) -> Seen:
    folder = tmp_path_factory.mktemp("browser")
    watched = folder / "watched.html"
    text = page.read_text(encoding="utf-8").replace("<style>", f"{WATCH}<style>", 1)
    watched.write_text(text.replace("</body>", f"{CLICK}</body>"), encoding="utf-8")
    became, console = opened(watched, folder)
    (found,) = re.findall(r'<pre id="told">(.*?)</pre>', became, re.DOTALL)
    return Seen(json.loads(unescape(found)), console)


def test_the_browser_finds_no_error_and_asks_for_nothing(seen: Seen) -> None:
    assert seen.console == []
    assert seen.told["errors"] == []
    assert seen.told["refused"] == []
    assert [name for name in seen.told["loaded"] if not name.startswith("data:")] == []
    assert len(seen.told["pictures"]) == 2
    assert min(seen.told["pictures"]) > 100


def test_what_is_hostile_is_text(page: Path, seen: Seen) -> None:
    assert seen.told["title"] == f"What? {BAD}"
    assert page.read_text(encoding="utf-8").count("<script>") == 1


def test_a_click_on_a_heading_sorts_and_a_second_one_the_other_way_round(seen: Seen) -> None:
    clicked = {each["heading"]: each for each in seen.told["clicked"]}
    assert len(seen.told["clicked"]) > 15
    for each in seen.told["clicked"]:
        assert sorted(each["before"]) == sorted(each["once"]) == sorted(each["twice"])
        assert (each["up"], each["down"]) == ("ascending", "descending")
    assert clicked["order"]["once"] == ["9", "10", "100", "budget spent", ""]
    assert clicked["order"]["twice"] == ["100", "10", "9", "budget spent", ""]
    assert clicked["residual"]["once"] == ["-1", "4.7e-10", "3e-8", "0.2", "1.5 (2) within"]
    assert clicked["inside the method [s]"]["once"] == ["0.5", "1", "4", "12"]
    assert clicked["inside the method [s]"]["twice"] == ["12", "4", "1", "0.5"]


def test_a_request_and_an_error_would_be_seen(page: Path, tmp_path: Path) -> None:
    """Planted: a picture from elsewhere, and a script that fails."""
    bad = tmp_path / "bad.html"
    text = page.read_text(encoding="utf-8").replace("</h1>", '</h1><img src="https://example.org/a.png">', 1)
    bad.write_text(text.replace('"use strict";', '"use strict"; nothing.here;', 1), encoding="utf-8")
    _, console = opened(bad, tmp_path)
    assert any("example.org" in line for line in console)
    assert any("nothing is not defined" in line for line in console)
