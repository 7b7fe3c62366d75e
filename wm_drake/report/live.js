"use strict";
/* Unpacks the page that runs the machine into its frame when its section is opened first. */
for (const section of document.querySelectorAll("details.live")) {
  const frame = section.querySelector("iframe");
  section.addEventListener("toggle", async () => {
    if (!section.open || frame.dataset.begun) return;
    frame.dataset.begun = "yes";
    const packed = Uint8Array.from(atob(document.getElementById("live-page").textContent), c => c.charCodeAt(0));
    const text = new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
    frame.src = URL.createObjectURL(new Blob([await text], { type: "text/html;charset=utf-8" }));
  });
}
