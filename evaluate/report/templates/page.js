"use strict";

const films = [...document.querySelectorAll("video")];
document.querySelectorAll("button.play").forEach(button => {
  button.hidden = films.length < 2;
  button.addEventListener("click", () => films.forEach(film => { film.currentTime = 0; film.play(); }));
});

// The numbers of a plot under the pointer: each panel carries points [x, y or null, text] in its own units.
const reading = document.getElementById("reading");

function nearest(points, x, y) {
  const distance = ([px, py]) => Math.hypot(px - x, py === null ? 0 : py - y);
  return points.reduce((best, point) => distance(point) < distance(best) ? point : best);
}

function place(event) {
  const margin = 14, {width, height} = reading.getBoundingClientRect();
  const left = Math.min(event.clientX + margin, innerWidth - width - 6);
  const above = event.clientY - height - margin;
  reading.style.left = `${Math.max(6, left)}px`;
  reading.style.top = `${above > 6 ? above : event.clientY + margin}px`;
}

document.querySelectorAll("svg[data-readings]").forEach(svg => {
  const {box: [left, top, right, bottom], points} = JSON.parse(svg.dataset.readings);
  const cursor = document.createElementNS("http://www.w3.org/2000/svg", "path");
  cursor.setAttribute("class", "cursor");
  svg.append(cursor);
  const hide = () => { reading.hidden = true; cursor.setAttribute("d", ""); };
  svg.addEventListener("pointerleave", hide);
  svg.addEventListener("pointermove", event => {
    const {x, y} = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    if (x < left || x > right || y < top || y > bottom) return hide();
    const [px, py, text] = nearest(points, x, y);
    reading.textContent = text;
    reading.hidden = false;
    cursor.setAttribute("d", py === null ? `M${px} ${top}V${bottom}` : `M${px - 4} ${py}h8M${px} ${py - 4}v8`);
    place(event);
  });
});

// A link to a folded part opens it.
document.querySelectorAll("nav a").forEach(link => link.addEventListener("click", () => {
  const part = document.querySelector(link.hash);
  if (part.matches("details")) part.open = true;
}));

// On paper nothing can be unfolded.
let unfolded = [];
addEventListener("beforeprint", () => {
  unfolded = [...document.querySelectorAll("details:not([open])")];
  unfolded.forEach(each => { each.open = true; });
});
addEventListener("afterprint", () => unfolded.forEach(each => { each.open = false; }));
