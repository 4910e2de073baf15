// The page: a file is dropped, fused and drawn; a GPS cut is drawn on the timeline and flown.
import { SENSOR, BUILD } from "../flownav.js";
import { readRecord, readCsv } from "./record.js";
import { fuse, longest, scores } from "./fusing.js";
import { interp } from "./figures.js";

const $ = (name) => document.getElementById(name);
const module = Uint8Array.from(atob($("module").textContent.trim()), (c) => c.charCodeAt(0));
const builtFor = JSON.parse($("built-for").textContent);
let flight = null, cut = null;

const state = (name, text) => { document.documentElement.dataset.state = name; $("state").textContent = text; };
const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);
const sorted = (o) => (o && typeof o === "object" && !Array.isArray(o) ? Object.fromEntries(Object.keys(o).sort().map((k) => [k, sorted(o[k])])) : o);

// Why a record cannot be fused by this page, or "".
function unlike(manifest, segment) {
  const told = manifest?.parameters?.filter, own = Object.keys(builtFor.equipment).filter((name) => !["deadline_s", "declination_rad"].includes(name));
  if (!told) return "";
  const differ = Object.keys(builtFor.filter).filter((name) => !same(sorted(told[name]), sorted(builtFor.filter[name])));
  if (differ.length) return `it was flown with other settings (${differ.slice(0, 3).join(", ")})`;
  if (!same(sorted(manifest.parameters.flow_noise ?? null), sorted(builtFor.flow_noise))) return "it was flown with another flow sensor";
  const other = own.filter((name) => Number(segment[name]) !== Number(builtFor.equipment[name]));
  return other.length ? `its vehicle carries other sensors (${other.join(", ")})` : "";
}

async function load(file) {
  try {
    state("busy", `reading ${file.name}`);
    const text = /\.csv$/i.test(file.name);
    const found = text ? readCsv(await file.text()) : readRecord(new Uint8Array(await file.arrayBuffer()));
    const rows = longest(found.fed), number = found.fed.segment ? found.fed.segment[rows[0]] : 0;
    const segment = found.manifest?.segments?.[number] ?? null, why = segment ? unlike(found.manifest, segment) : "";
    if (why) throw new Error(`${why}: write a page for it with \`flownav build --target wasm32 --record ${file.name}\``);
    flight = { ...found, rows, segment, name: file.name, delayS: Number(found.manifest?.parameters?.gps_delay_s ?? builtFor.gps_delay_s) };
    cut = null;
    await fly();
  } catch (error) {
    flight = null;
    state("failed", `${file.name}: ${error.message}`);
  }
}

async function fly() {
  const flown = await fuse(module, flight.fed, flight.rows, flight.segment, cut, async (share) => {
    state("busy", `fusing: ${Math.round(100 * share)} %`);
    await new Promise((go) => setTimeout(go));
  });
  if (!flown.estimates.length) throw new Error("the filter never started: it needs an attitude or an IMU, then a GPS fix or flow");
  const said = scores(flown, flight.fed, flight.truth, flight.delayS, cut);
  flight.flown = flown; flight.said = said;
  $("figures").dataset.json = JSON.stringify(said.numbers);
  table(said.numbers);
  draw();
  state("done", `${flight.name}: ${flight.rows.length} readings, ${flown.estimates.length} estimates`);
}

// -- figures in words ---------------------------------------------------------------------------------------------
const metres = (value, digits = 3) => (value === null || value === undefined || !Number.isFinite(value) ? "-" : value.toFixed(digits));
function table(n) {
  const rows = [["digest after the last reading", n.digest]];
  for (const o of n.outages) rows.push([`GPS cut from ${o.t0.toFixed(2)} to ${o.t1.toFixed(2)} s: rms, most [m]`, `${metres(o.horizontal_rms_m)}, ${metres(o.horizontal_max_m)}`]);
  if (n.truth) rows.push(["against the truth: horizontal rms, most [m]", `${metres(n.truth.horizontal_rms_m)}, ${metres(n.truth.horizontal_max_m)}`], ["vertical rms [m]", metres(n.truth.vertical_rms_m)]);
  rows.push(["velocity against GPS, rms [m/s]", metres(n.velocity_rms_m_s)]);
  if (n.protection) rows.push(["protection level, median: horizontal, vertical [m]", `${metres(n.protection.horizontal_m.median, 2)}, ${metres(n.protection.vertical_m.median, 2)}`]);
  for (const [name, { nis_per_dof: nis, samples }] of Object.entries(n.consistency)) {
    const lost = Object.entries(n.rejected[name] ?? {}).map(([why, count]) => `${count} ${why}`).join(", ");
    rows.push([`${name}: innovation squared over what is expected, of ${samples}`, `${nis.toFixed(2)}${lost ? `; not fused: ${lost}` : ""}`]);
  }
  $("figures").replaceChildren(...rows.map(([what, value]) => {
    const row = document.createElement("tr");
    for (const text of [what, value]) { const cell = document.createElement("td"); cell.textContent = text; row.append(cell); }
    return row;
  }));
}

// -- drawings -----------------------------------------------------------------------------------------------------
const INK = "#1d3557", RED = "#c1121f", SOFT = "#a8c5da", GREY = "#777";
function plot(name, lines, { band = null, dots = [], square = false, zero = false, label = "" } = {}) {
  const canvas = $(name), scale = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * scale; canvas.height = height * scale;
  const c = canvas.getContext("2d"), left = 52, bottom = 24, top = 10, right = 8;
  c.scale(scale, scale);
  const every = [...lines, ...dots, ...(band ? [{ x: band.x, y: band.low }, { x: band.x, y: band.high }] : [])].filter((l) => l.x.length);
  if (!every.length) return null;
  const bounds = (key) => { let low = Infinity, high = -Infinity; for (const l of every) for (const v of l[key]) if (Number.isFinite(v)) { low = Math.min(low, v); high = Math.max(high, v); } return [low, high]; };
  let [x0, x1] = bounds("x"), [y0, y1] = bounds("y");
  if (zero) y0 = Math.min(0, y0);
  if (!(x1 > x0)) x1 = x0 + 1;
  if (!(y1 > y0)) { y0 -= 0.5; y1 += 0.5; }
  let sx = (width - left - right) / (x1 - x0), sy = (height - bottom - top) / (y1 - y0);
  if (square) { sx = sy = Math.min(sx, sy); }
  const X = (x) => left + (x - x0) * sx, Y = (y) => height - bottom - (y - y0) * sy;
  c.font = "11px system-ui"; c.fillStyle = GREY; c.strokeStyle = "#e4e4e4";
  const ticks = (a, b) => { const step = 10 ** Math.floor(Math.log10((b - a) / 3)), by = [1, 2, 5, 10].map((m) => m * step).find((s) => (b - a) / s <= 6); const out = []; for (let v = Math.ceil(a / by) * by; v <= b + 1e-9; v += by) out.push(v); return out; };
  for (const v of ticks(x0, x1)) { c.beginPath(); c.moveTo(X(v), top); c.lineTo(X(v), height - bottom); c.stroke(); c.fillText(+v.toPrecision(6), X(v) - 8, height - 8); }
  for (const v of ticks(y0, y1)) { c.beginPath(); c.moveTo(left, Y(v)); c.lineTo(width - right, Y(v)); c.stroke(); c.fillText(+v.toPrecision(4), 6, Y(v) + 4); }
  if (cut && !square) { c.fillStyle = "rgba(193,18,31,.12)"; c.fillRect(X(cut[0]), top, (cut[1] - cut[0]) * sx, height - bottom - top); }
  if (band) { c.fillStyle = "rgba(69,123,157,.25)"; c.beginPath(); band.x.forEach((x, i) => c.lineTo(X(x), Y(band.high[i]))); for (let i = band.x.length - 1; i >= 0; i--) c.lineTo(X(band.x[i]), Y(band.low[i])); c.fill(); }
  for (const { x, y, ink = INK } of lines) { c.strokeStyle = ink; c.lineWidth = 1.4; c.beginPath(); let on = false; for (let i = 0; i < x.length; i++) { if (!Number.isFinite(y[i])) { on = false; continue; } if (on) c.lineTo(X(x[i]), Y(y[i])); else c.moveTo(X(x[i]), Y(y[i])); on = true; } c.stroke(); }
  for (const { x, y, ink = INK } of dots) { c.fillStyle = ink; for (let i = 0; i < x.length; i++) c.fillRect(X(x[i]) - 0.8, Y(y[i]) - 0.8, 1.6, 1.6); }
  c.fillStyle = "#333"; c.fillText(label, left + 4, top + 10);
  return { t: (px) => Math.min(Math.max(x0 + (px - left) / sx, x0), x1) };
}

let timeline = null;
function draw() {
  const { estimates, innovations } = flight.flown, { path, error, moved } = flight.said, t = path.t;
  const sigma = (k) => estimates.map((row) => Math.sqrt(row.pose_covariance[k]));
  const truth = moved ? { x: moved.map((row) => row[1]), y: moved.map((row) => row[0]), ink: SOFT } : null;
  plot("path", [...(truth ? [truth] : []), { x: path.columns[1], y: path.columns[0] }], { square: true, label: "north over east [m]" });
  const north = path.columns[0], deviation = sigma(0);
  timeline = plot("timeline", [{ x: t, y: north }, ...(moved ? [{ x: [...flight.truth.t_s], y: moved.map((row) => row[0]), ink: SOFT }] : [])], {
    band: { x: t, low: north.map((v, i) => v - 2 * deviation[i]), high: north.map((v, i) => v + 2 * deviation[i]) }, label: "north and 2 sigma [m]; draw a GPS cut here",
  });
  const level = estimates.map((row) => row.protection_m[0]);
  const covered = flight.truth ? [...flight.truth.t_s].filter((at) => at >= t[0] && at <= t.at(-1)) : [];
  plot("level", [{ x: t, y: level, ink: RED }, ...(error ? [{ x: covered, y: error.map((row) => Math.hypot(row[0], row[1])) }] : [])], { zero: true, label: "horizontal protection level (red) and error [m]" });
  const inks = ["#1d3557", "#c1121f", "#2a9d8f", "#e9c46a", "#9b5de5", "#f15bb5", "#577590"];
  const tested = Object.entries(SENSOR).map(([, value], i) => ({ rows: innovations.filter((row) => row.sensor === value && row.innovation_variance > 0), ink: inks[i % inks.length] }));
  plot("innovations", [], { dots: tested.map(({ rows, ink }) => ({ x: rows.map((row) => row.t_s), y: rows.map((row) => row.innovation / Math.sqrt(row.innovation_variance)), ink })), label: "innovations over their sigma, a colour each sensor" });
}

// -- what is done -------------------------------------------------------------------------------------------------
let from = null;
const within = (event) => timeline.t(event.clientX - $("timeline").getBoundingClientRect().left);
$("timeline").addEventListener("pointerdown", (event) => { if (timeline) { from = within(event); $("timeline").setPointerCapture(event.pointerId); } });
$("timeline").addEventListener("pointermove", (event) => { if (from !== null) { const to = within(event); cut = [Math.min(from, to), Math.max(from, to)]; draw(); } });
$("timeline").addEventListener("pointerup", async (event) => {
  if (from === null) return;
  const to = within(event), wide = Math.abs(to - from) >= 0.5;
  cut = wide ? [Math.min(from, to), Math.max(from, to)] : null;
  from = null;
  showCut();
  await again();
});
async function again() {
  if (flight) try { await fly(); } catch (error) { state("failed", error.message); }
}
function showCut() { $("from").value = cut ? cut[0].toFixed(2) : ""; $("to").value = cut ? cut[1].toFixed(2) : ""; }
$("cut").addEventListener("submit", async (event) => {
  event.preventDefault();
  const bounds = [Number($("from").value), Number($("to").value)];
  cut = $("from").value !== "" && bounds[1] > bounds[0] ? bounds : null;
  await again();
});
$("file").addEventListener("change", (event) => event.target.files[0] && load(event.target.files[0]));
addEventListener("dragover", (event) => event.preventDefault());
addEventListener("drop", (event) => { event.preventDefault(); const [file] = event.dataTransfer.files; if (file) load(file); });
addEventListener("resize", () => flight && draw());
$("build").textContent = BUILD;
state("waiting", "Drop a record (.fnr) or a CSV file of readings here.");
