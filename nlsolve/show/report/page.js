"use strict";
// A click on a heading sorts its table by that column, a second one the other way round. Numbers come before words,
// and empty cells last; rows with equal cells stay in their order.
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(?=\s|$)/i;

function keyOf(cell) {
  const words = cell.textContent.trim();
  const found = NUMBER.exec(words);
  return { words, number: found ? Number(found[0]) : NaN, rank: words === "" ? 2 : found ? 0 : 1 };
}

function compared(a, b, sign) {
  if (a.rank !== b.rank) return a.rank - b.rank;
  return sign * (a.rank === 0 ? a.number - b.number : a.words.localeCompare(b.words));
}

function sort(table, heading) {
  const descending = heading.getAttribute("aria-sort") === "ascending";
  for (const other of heading.parentNode.cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", descending ? "descending" : "ascending");
  const body = table.tBodies[0];
  const rows = Array.from(body.rows, (row) => ({ row, key: keyOf(row.cells[heading.cellIndex]) }));
  rows.sort((a, b) => compared(a.key, b.key, descending ? -1 : 1));
  body.append(...rows.map((each) => each.row));
}

for (const table of document.querySelectorAll("table.sorts")) {
  for (const heading of table.tHead.rows[0].cells) {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    button.addEventListener("click", () => sort(table, heading));
    heading.append(button);
  }
}
