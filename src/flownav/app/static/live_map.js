// The path of a live session from above: what was sent, what was withheld, where it is and how far off that may be.

import { el, points, svg } from "./dom.js";

const SIZE = 420, MARGIN = 26, LEAST_M = 4, WIDEST = 2.5;

// Runs of a path that were sent, or withheld, each joined to the next one.
export function runs(path) {
  const found = [];
  for (const point of path) {
    const last = found[found.length - 1];
    if (last && last.sent === point[2]) last.points.push(point);
    else found.push({ sent: point[2], points: last ? [last.points[last.points.length - 1], point] : [point] });
  }
  return found;
}

// The longest of 1, 2, 5, 10, ... metres that is no longer than a limit.
function bar(most) {
  const ten = 10 ** Math.floor(Math.log10(most));
  return [5, 2, 1].map((step) => step * ten).find((length) => length <= most);
}

// How long a length is in a map of SIZE pixels with `scale` pixels a metre.
export function scaleBar(scale) {
  const length = bar((SIZE - 2 * MARGIN) / 3 / scale);
  return [svg("line", { class: "bar", x1: MARGIN, x2: MARGIN + scale * length, y1: SIZE - 14, y2: SIZE - 14 }),
    svg("text", { x: MARGIN + scale * length + 8, y: SIZE - 10 }, `${length} m`)];
}

function levelWords(reach, shown) {
  if (shown > 0) return "; the circle is the protection level about the vehicle";
  return reach > 0 ? `; the protection level, ${reach.toFixed(0)} m about the vehicle, is wider than the picture` : "";
}

export function whole(now) {
  const here = now.here_ned_m;
  if (!here) return [el("figcaption", {}, "The path is drawn once the filter has started.")];
  const reach = now.protection_m ? now.protection_m[0] : 0;
  const flown = [...now.path, ...(now.pad_m ? [now.pad_m] : []), here];
  const span = Math.max(...[0, 1].map((k) => Math.max(...flown.map((row) => row[k])) - Math.min(...flown.map((row) => row[k]))), LEAST_M);
  const shown = reach <= WIDEST * span ? reach : 0;  // a circle that is much wider would make a dot of the path
  const all = [...flown, [here[0] - shown, here[1] - shown], [here[0] + shown, here[1] + shown]];
  const [n0, n1, e0, e1] = [0, 1].flatMap((k) => [Math.min(...all.map((row) => row[k])), Math.max(...all.map((row) => row[k]))]);
  const scale = (SIZE - 2 * MARGIN) / Math.max(n1 - n0, e1 - e0, LEAST_M);
  const at = ([north, east]) => [SIZE / 2 + scale * (east - (e0 + e1) / 2), SIZE / 2 - scale * (north - (n0 + n1) / 2)];
  const [x, y] = at(here);
  const pad = now.pad_m ? at(now.pad_m) : null;
  const drawing = svg("svg", { class: "chart map", viewBox: `0 0 ${SIZE} ${SIZE}`, role: "img", "aria-label": `The path from above, north up; the vehicle is ${here[0].toFixed(1)} m north and ${here[1].toFixed(1)} m east of the start` },
    shown > 0 && svg("circle", { class: "level", cx: x, cy: y, r: Math.max(1, scale * shown) }),
    pad && svg("rect", { class: "pad", x: pad[0] - 6, y: pad[1] - 6, width: 12, height: 12 }),
    pad && svg("text", pad[0] > SIZE - 2 * MARGIN ? { x: pad[0] - 10, y: pad[1] + 4, "text-anchor": "end" } : { x: pad[0] + 10, y: pad[1] + 4 }, "pad"),
    runs(now.path).map((run) => svg("polyline", { class: run.sent ? "estimate" : "withheld", points: points(run.points, at) })),
    svg("circle", { class: now.reason ? "place withheld" : "place", cx: x, cy: y, r: 6 }),
    scaleBar(scale),
    svg("text", { x: SIZE - MARGIN, y: 18, "text-anchor": "end" }, "north ↑"));
  return [drawing, el("figcaption", {}, `From above: the path, red where nothing was sent${levelWords(reach, shown)}.`)];
}
