// Sorts and filters the fault table. Without this script the table shows all rows in the order of the data.
document.addEventListener("DOMContentLoaded", () => {
  const box = document.getElementById("faults");
  if (!box) return;
  const body = box.querySelector("tbody");
  const rows = [...body.rows];
  const count = document.createElement("output");

  const select = (column, label) => {
    const menu = document.createElement("select");
    menu.setAttribute("aria-label", label);
    menu.add(new Option(label, ""));
    for (const value of new Set(rows.map((row) => row.cells[column].textContent))) menu.add(new Option(value));
    menu.addEventListener("change", filter);
    return menu;
  };
  const words = document.createElement("input");
  words.type = "search";
  words.placeholder = "word, such as gyro";
  words.setAttribute("aria-label", "words in a row");
  words.addEventListener("input", filter);
  const policy = select(0, "all policies");
  const part = select(1, "all parts");

  function filter() {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const text = row.textContent.toLowerCase();
      row.hidden =
        !wanted.every((word) => text.includes(word)) ||
        (policy.value && row.cells[0].textContent !== policy.value) ||
        (part.value && row.cells[1].textContent !== part.value);
      shown += !row.hidden;
    }
    count.textContent = `${shown} of ${rows.length} rows`;
  }

  function sort(head) {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of box.querySelectorAll("th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const key = (row) => row.cells[head.cellIndex].textContent;
    rows.sort((a, b) => key(a).localeCompare(key(b), undefined, { numeric: true }) * (down ? -1 : 1));
    body.append(...rows);
  }

  for (const head of box.querySelectorAll("th")) {
    head.tabIndex = 0;
    head.addEventListener("click", () => sort(head));
    head.addEventListener("keydown", (event) => event.key === "Enter" && sort(head));
  }
  const bar = document.createElement("p");
  bar.className = "filters";
  bar.append(policy, part, words, count);
  box.prepend(bar);
  filter();
});
