// Tables of class "data" sort by a click on a head, and longer ones have a field that filters rows.
// The controls are made here, so a page without scripts shows none that does nothing.
{
  const FILTERED = 8; // rows from which on a table has a filter

  // What a cell is sorted by: its number [unit of the column], or its text; undefined if empty.
  const valueOf = (cell, numeric) => {
    const text = cell.dataset.v ?? cell.textContent.trim();
    if (!numeric) return text || undefined;
    const number = parseFloat(text.replace("−", "-").replace("∞", "Infinity"));
    return Number.isNaN(number) ? undefined : number;
  };

  // Rows in the order of a column; empty cells come last either way, equal ones stay as they are.
  const sorted = (rows, column, numeric, sign) => {
    const keys = new Map(rows.map((row) => [row, valueOf(row.cells[column], numeric)]));
    const order = (a, b) =>
      numeric ? a - b || 0 : a.localeCompare(b, "en", { numeric: true });
    return [...rows].sort((one, other) => {
      const [a, b] = [keys.get(one), keys.get(other)];
      if (a === undefined || b === undefined) return (a === undefined) - (b === undefined);
      return sign * order(a, b);
    });
  };

  const addSorting = (table, rows) => {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      // First up, then down, then as the page was written.
      button.addEventListener("click", () => {
        const order = { ascending: "descending", descending: "" }[head.ariaSort] ?? "ascending";
        heads.forEach((each) => each.removeAttribute("aria-sort"));
        if (order) head.setAttribute("aria-sort", order);
        const numeric = head.classList.contains("number");
        const sign = order === "descending" ? -1 : 1;
        table.tBodies[0].append(...(order ? sorted(rows, column, numeric, sign) : rows));
      });
    });
  };

  const addFilter = (table, rows) => {
    const field = document.createElement("input");
    field.type = "search";
    field.placeholder = `filter ${rows.length} rows`;
    field.setAttribute("aria-label", "rows with these words");
    const count = document.createElement("output");
    const bar = document.createElement("p");
    bar.className = "filter";
    bar.append(field, " ", count);
    table.parentElement.before(bar);
    const texts = rows.map((row) => row.textContent.toLowerCase());
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/);
      rows.forEach((row, number) => {
        row.hidden = !words.every((word) => texts[number].includes(word));
      });
      const shown = rows.filter((row) => !row.hidden).length;
      count.value = shown < rows.length ? `${shown} of ${rows.length}` : "";
    });
  };

  for (const table of document.querySelectorAll("table.data")) {
    const rows = [...table.tBodies[0].rows];
    addSorting(table, rows);
    if (rows.length >= FILTERED) addFilter(table, rows);
  }

  // A link in a list of repeats leads to a place of the page, so the list makes room for it.
  document.addEventListener("click", (event) => {
    event.target.closest("[popover] a")?.closest("[popover]").hidePopover();
  });
}
