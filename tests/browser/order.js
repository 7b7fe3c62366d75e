/* Returns what is wrong with the order of a page: the answer in words and numbers, then pictures,
   then tables, then how it was made. A table that belongs to the answer (what to change, what to do) or
   to a control is not a table of results. */
const faults = [];
const summary = document.querySelector("main > .summary"), made = document.getElementById("run");
const figures = [...document.querySelectorAll("main figure")];
const tables = [...document.querySelectorAll("main table:not(.control)")].filter(table => !table.closest(".answer"));
const before = (a, b) => Boolean(a.compareDocumentPosition(b) & Node.DOCUMENT_POSITION_FOLLOWING);
if (!summary || !/\d/.test(summary.textContent) || !/[.]$/.test(summary.textContent.trim())) faults.push("no answer with numbers");
if (!made || !made.querySelector("dl")) faults.push("nothing says how the page was made");
if (!figures.length) faults.push("no picture");
if (summary && made) {
  for (const one of [...figures, ...tables]) if (!before(summary, one)) faults.push(`before the answer: ${one.textContent.trim().slice(0, 40)}`);
  for (const figure of figures) for (const table of tables)
    if (before(table, figure)) { faults.push(`table before a picture: ${table.textContent.trim().slice(0, 40)}`); break; }
  for (const figure of figures) if (!before(figure, made)) faults.push("picture after the details");
  const after = made.nextElementSibling;
  if (!after || after.id !== "references") faults.push("the details are not the last section");
}
return [...new Set(faults)];
