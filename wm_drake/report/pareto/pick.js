"use strict";
const given = JSON.parse(document.getElementById("designs").textContent);
const designs = given.rows;
const marks = [...document.querySelectorAll("#plot circle")];
let picked = given.picked;
function pick(number) {
  picked = Math.max(0, Math.min(designs.length - 1, number));
  marks.forEach((mark, i) => mark.setAttribute("fill", i === picked ? "#b34700" : "#0072b2"));
  document.getElementById("picked-title").textContent = "Design " + (picked + 1);
  const body = document.querySelector("#picked tbody");
  body.replaceChildren(...designs[picked].map(cells => {
    const row = document.createElement("tr");
    cells.forEach(text => { const cell = document.createElement("td"); cell.textContent = text; row.append(cell); });
    return row;
  }));
}
marks.forEach((mark, i) => mark.addEventListener("click", () => pick(i)));
document.getElementById("plot").addEventListener("keydown", event => {
  const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
  if (step) { event.preventDefault(); pick(picked + step); }
});
pick(picked);
