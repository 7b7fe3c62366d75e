/* Returns what is wrong with the layout of a page: text cut off, beyond the page, over other text.
   On paper nothing can be scrolled: there no table may be wider than the page. */
const faults = [], isPaper = matchMedia("print").matches;
const room = document.documentElement.clientWidth;
if (document.documentElement.scrollWidth > room) faults.push(`page is ${document.documentElement.scrollWidth} wide in ${room}`);
const said = node => (node.textContent || node.value || node.tagName).trim().slice(0, 40);
const shown = node => { const r = node.getBoundingClientRect(); return r.width > 0 && r.height > 0 && getComputedStyle(node).visibility !== "hidden"; };
// words of the page: inside the window, and not wider than their box
for (const node of document.querySelectorAll("main h1, main h2, main h3, main p, main li, main caption, main figcaption, main dt, main dd, main th, main td, main button, main label, main select, main input, main small, main output")) {
  if (!shown(node)) continue;
  const r = node.getBoundingClientRect(), scroller = node.closest(".scroll");
  if (!scroller && (r.right > room + 1 || r.left < -1)) faults.push(`beyond the page: ${said(node)}`);
  if (node.tagName === "INPUT" && !["range", "checkbox"].includes(node.type) && node.scrollWidth > node.clientWidth + 1) faults.push(`value is clipped: ${said(node)}`);
  if (node.scrollWidth > node.clientWidth + 1 && getComputedStyle(node).display !== "inline" && !["SELECT", "INPUT"].includes(node.tagName)) faults.push(`wider than its box: ${said(node)}`);
}
for (const scroller of document.querySelectorAll(".scroll")) {
  const r = scroller.getBoundingClientRect();
  if (r.right > room + 1) faults.push(`scrolled region beyond the page: ${said(scroller)}`);
  if ((isPaper || scroller.closest("figure")) && scroller.scrollWidth > 0 && [...scroller.children].some(node => node.getBoundingClientRect().right > room + 1)) faults.push(`wider than the paper: ${said(scroller)}`);
  if (scroller.closest("figure") && scroller.scrollWidth > scroller.clientWidth + 1) faults.push(`picture is cut off: ${scroller.scrollWidth} in ${scroller.clientWidth}`);
}
// texts of pictures: inside the picture, and apart from each other
for (const plot of document.querySelectorAll("figure[data-picture] .plot, .contour")) {
  const frame = plot.getBoundingClientRect(), texts = [];
  for (const node of plot.querySelectorAll(".main-svg text")) {
    if (!shown(node) || !node.textContent.trim() || node.closest(".hoverlayer")) continue;
    const r = node.getBoundingClientRect();
    if (r.left < frame.left - 2 || r.right > frame.right + 2 || r.top < frame.top - 2 || r.bottom > frame.bottom + 2)
      faults.push(`text leaves its picture: ${said(node)} in ${plot.getAttribute("aria-label")}`);
    texts.push([r, node]);
  }
  for (let i = 0; i < texts.length; i++) for (let j = i + 1; j < texts.length; j++) {
    const [a, u] = texts[i], [b, v] = texts[j];
    const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left), high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (wide > 2 && high > 3 && said(u) !== said(v)) faults.push(`texts overlap: ${said(u)} and ${said(v)} in ${plot.getAttribute("aria-label")}`);
  }
}
return faults;
