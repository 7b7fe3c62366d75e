"use strict";
/* Shows the design that a reader picks: its point on the front, its numbers, its envelopes. */
const Picked = (() => {
  const given = JSON.parse(document.getElementById("designs").textContent), { labels } = given;
  const plot = document.getElementById("plot");
  const front = plot && plot.querySelector("figure"), envelopes = document.querySelector("#envelopes figure");
  let picked = given.picked;

  const ofPicked = data => data.filter(trace => trace.meta && trace.meta.name === labels.picked);

  function pick(number) {
    picked = Math.max(0, Math.min(given.rows.length - 1, number));
    document.getElementById("picked-title").textContent = `Design ${picked + 1}`;
    document.querySelector("#picked tbody").replaceChildren(...given.rows[picked].map(cells => {
      const row = document.createElement("tr");
      cells.forEach(text => row.append(Object.assign(document.createElement("td"), { textContent: text })));
      return row;
    }));
    if (front) {
      Pictures.change(front, data => ofPicked(data).forEach((trace, k) => {
        [trace.x, trace.y] = given.pairs[k].map(goal => [given.objectives[picked][goal]]);
      }));
    }
    Pictures.change(envelopes, data => ofPicked(data).forEach((trace, k) => {
      trace.y = given.envelopes[picked][k];
    }));
  }

  if (front) {
    Pictures.clicked(front, point => {
      // a chosen design has a second point above its own
      const isAt = design => given.pairs.some(([i, j]) => Math.hypot(1 - design[i] / point.x, 1 - design[j] / point.y) < 1e-5);
      const found = point.name === labels.designs ? point.number : given.objectives.findIndex(isAt);
      if (found >= 0) pick(found);
    });
    plot.addEventListener("keydown", event => {
      const step = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (step) { event.preventDefault(); pick(picked + step); }
    });
  }
  pick(picked);
  return { pick, number: () => picked };
})();
