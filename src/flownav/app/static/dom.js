// Elements without markup as text: what a log or a file is called can never become part of the page's own code.

const SVG = "http://www.w3.org/2000/svg";

function made(node, properties, children) {
  for (const [name, value] of Object.entries(properties)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "value") node.value = value;
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return node;
}

export const el = (tag, properties = {}, ...children) => made(document.createElement(tag), properties, children);
export const svg = (tag, properties = {}, ...children) => made(document.createElementNS(SVG, tag), properties, children);
export const button = (text, onclick, properties = {}) => el("button", { type: "button", onclick, ...properties }, text);

// The pictures of a page name what clips them alike: each gets names of its own.
let pictures = 0;
function named(parsed) {
  const own = `-${++pictures}`;
  for (const clip of parsed.querySelectorAll("clipPath")) clip.id += own;
  for (const part of parsed.querySelectorAll("[clip-path]")) part.setAttribute("clip-path", part.getAttribute("clip-path").replace(")", `${own})`));
  return parsed;
}

// A picture that the reports' own functions drew, under its words.
export function picture(text, words) {
  const holder = el("figure", { class: "picture" });
  const parsed = new DOMParser().parseFromString(text, "text/html").body.firstElementChild;
  if (parsed) holder.append(named(document.adoptNode(parsed)));
  holder.append(el("figcaption", {}, words));
  return holder;
}

export function points(rows, place) {
  return rows.map((row) => place(row).map((value) => value.toFixed(1)).join(",")).join(" ");
}

// A path as a small picture, north up, with equal scales.
export function thumbnail(path, words) {
  const size = 72, margin = 6;
  if (!path || path.length < 2) return el("div", { class: "thumbnail none", "aria-hidden": true });
  const [north, east] = [0, 1].map((k) => path.map((row) => row[k]));
  const [n0, n1, e0, e1] = [Math.min(...north), Math.max(...north), Math.min(...east), Math.max(...east)];
  const scale = (size - 2 * margin) / Math.max(n1 - n0, e1 - e0, 0.5);
  const place = ([n, e]) => [size / 2 + scale * (e - (e0 + e1) / 2), size / 2 - scale * (n - (n0 + n1) / 2)];
  const [x, y] = place(path[0]);
  return svg("svg", { class: "thumbnail", viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": words },
    svg("polyline", { points: points(path, place) }), svg("circle", { cx: x, cy: y, r: 2.5 }));
}

export function notice(text) {
  const place = document.getElementById("notice");
  place.hidden = !text;
  place.replaceChildren(text, " ", button("Close", () => notice("")));
}

export function command(text) {
  return el("p", { class: "command" }, "The same on the command line: ", el("code", {}, text));
}

export function size(bytes) {
  if (bytes < 1e3) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}
