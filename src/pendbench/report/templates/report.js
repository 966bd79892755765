// Tables that sort by a click on a heading, and long ones that show only the rows with some words.
const FEW = 8;

function cellText(row, column) {
  return row.cells[column] ? row.cells[column].textContent.trim() : "";
}

// A number of people's writing, "1.2e-7", "8.9 s [7.9 .. never]"; NaN for what begins with none.
function numberOf(text) {
  const found = /^[-+]?\d+(\.\d+)?(e[-+]?\d+)?/i.exec(text);
  return found ? Number(found[0]) : NaN;
}

// What is no number comes last, whichever way.
function compared(one, other, upwards) {
  const [a, b] = [numberOf(one), numberOf(other)];
  const [noneA, noneB] = [Number.isNaN(a), Number.isNaN(b)];
  if (noneA && noneB) return upwards * one.localeCompare(other);
  if (noneA || noneB) return noneA ? 1 : -1;
  return upwards * (a - b);
}

function sortBy(table, column, heading) {
  const upwards = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
  for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", upwards > 0 ? "ascending" : "descending");
  const body = table.tBodies[0];
  const rows = [...body.rows];
  rows.sort((one, other) => compared(cellText(one, column), cellText(other, column), upwards));
  body.append(...rows);
}

function makeSortable(table) {
  [...table.tHead.rows[0].cells].forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.scope = "col";
    heading.append(button);
    button.addEventListener("click", () => sortBy(table, column, heading));
  });
}

function makeFilter(table, before) {
  const label = document.createElement("label");
  const input = document.createElement("input");
  label.className = "filter";
  input.type = "search";
  label.append(`${table.tBodies[0].rows.length} rows, of them those with`, input);
  before.before(label);
  input.addEventListener("input", () => {
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const row of table.tBodies[0].rows) {
      const text = row.textContent.toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
    }
  });
}

for (const table of document.querySelectorAll("table:not(.legend)")) {
  if (!table.tHead || !table.tBodies.length) continue;
  const box = document.createElement("div");
  box.className = "rows";
  box.tabIndex = 0;
  box.setAttribute("role", "group");
  box.setAttribute("aria-label", "table");
  table.replaceWith(box);
  box.append(table);
  makeSortable(table);
  if (table.tBodies[0].rows.length > FEW) makeFilter(table, box);
}

addEventListener("beforeprint", () => {
  for (const part of document.querySelectorAll("details")) part.open = true;
});

// The plots, and what moves, which waits to be asked.
function startReport() {
  const connect = chosenTheme(document.documentElement);
  const data = byId("data") ? JSON.parse(byId("data").textContent) : { charts: {}, stage: null };
  const plots = startPlots(data.charts);
  const moving = data.stage && startStage(data.stage, byId("motion"));
  connect(() => {
    for (const view of plots.views) view.redraw();
    if (moving) moving.redraw();
  });
  return { plots, ...moving };
}

window.pendbench = startReport();
