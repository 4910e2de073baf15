// GPS cut by drawing on the timeline: what the navigator makes of the log without it, beside GPS.

import { follow, post, start, state } from "./ask.js";
import { button, command, el, points, svg } from "./dom.js";
import { scaleBar } from "./live_map.js";

const HIGH = 220, LEFT = 44, RIGHT = 8, TOP = 12, BOTTOM = 26;
const LEAST_S = 1;

export function show(main, asked) {
  let name = asked, cuts = [], answer = null, busy = false, again = false, drawing = null, wide = 1000;
  const pick = el("select", { "aria-label": "Log", onchange: () => choose(pick.value) });
  const flow = el("input", { type: "checkbox", onchange: ask });
  flow.checked = true;
  const scale = ["x", "y"].map((axis) => slider(`Flow scale ${axis}`, 0.5, 1.5, 0.05, 1));
  const delay = slider("GPS delay [s]", 0, 1, 0.02, 0.22);
  const from = numberField("from [s]"), to = numberField("to [s]");
  const status = el("p", { role: "status" });
  const chart = svg("svg", { class: "chart drawn", viewBox: `0 0 ${wide} ${HIGH}`, role: "img",
    "aria-label": "Distance of the estimate from GPS over time; draw to cut GPS" });
  const map = el("div"), table = el("div", { class: "scroll" }), same = el("div");

  function slider(title, min, max, step, value) {
    const out = el("output", {}, String(value));
    const input = el("input", { type: "range", min, max, step, value, oninput: () => { out.value = input.value; ask(); } });
    return { input, box: el("label", {}, title, out, input) };
  }
  function numberField(title) {
    const input = el("input", { type: "number", step: "any", "aria-label": `Cut GPS ${title}` });
    return { input, box: el("label", { class: "seconds" }, title, " ", input) };
  }
  const place = (t) => LEFT + (wide - LEFT - RIGHT) * (t - answer.span_s[0]) / (answer.span_s[1] - answer.span_s[0]);
  const time = (event) => {
    const box = chart.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width * wide;
    const [t0, t1] = answer.span_s;
    return Math.min(t1, Math.max(t0, t0 + (t1 - t0) * (x - LEFT) / (wide - LEFT - RIGHT)));
  };
  const question = () => ({
    what: "cut", file: name, cuts, flow: flow.checked, flow_scale: scale.map(({ input }) => Number(input.value)),
    gps_delay_s: Number(delay.input.value),
  });

  async function ask() {
    if (!name) return;
    if (busy) { again = true; return; }
    busy = true;
    status.textContent = "is replayed ...";
    const began = performance.now(), of = name;
    try {
      const found = await post("api/ask", question());
      if (of === name) { answer = found; status.textContent = `answered in ${((performance.now() - began) / 1e3).toFixed(2)} s`; }
    } catch (error) {
      status.textContent = error.message;
    }
    busy = false;
    if (answer) draw();
    if (again) { again = false; ask(); }
  }

  function choose(next) {
    name = next;
    cuts = [];
    answer = null;
    chart.replaceChildren();
    [map, table, same].forEach((each) => each.replaceChildren());
    history.replaceState(null, "", `#cut/${encodeURIComponent(name)}`);
    const look = (state.files.find((file) => file.name === name) || {}).look || {};
    for (const each of [...scale, delay]) each.input.disabled = Boolean(look.fed);
    ask();
  }

  function setCuts(next) {
    cuts = next.map(([a, b]) => [Number(a.toFixed(2)), Number(b.toFixed(2))]).sort((a, b) => a[0] - b[0]);
    draw();
    ask();
  }

  // Drawn as wide as it stands, so that its words keep their size on a phone.
  function drawChart() {
    wide = Math.max(240, Math.round(chart.getBoundingClientRect().width));
    chart.setAttribute("viewBox", `0 0 ${wide} ${HIGH}`);
    const most = Math.max(1, ...answer.away.map(([, away]) => away));
    const down = (away) => HIGH - BOTTOM - (HIGH - TOP - BOTTOM) * away / most;
    const shown = drawing ? [...cuts, [Math.min(...drawing), Math.max(...drawing)]] : cuts;
    const ticks = [0, 0.25, 0.5, 0.75, 1].map((part) => answer.span_s[0] + part * (answer.span_s[1] - answer.span_s[0]));
    chart.replaceChildren(
      ...shown.map(([a, b]) => svg("rect", { class: "cut", x: place(a), y: TOP, width: Math.max(1, place(b) - place(a)), height: HIGH - TOP - BOTTOM })),
      svg("line", { x1: LEFT, x2: wide - RIGHT, y1: down(0), y2: down(0) }),
      svg("text", { x: 4, y: TOP + 10 }, `${most.toFixed(1)} m`), svg("text", { x: 4, y: down(0) }, "0"),
      ...ticks.map((t, k) => svg("text", { x: place(t), y: HIGH - 8, "text-anchor": ["start", "middle", "middle", "middle", "end"][k] }, `${Math.round(t) + 0} s`)),
      svg("polyline", { class: "estimate", points: points(answer.away, ([t, away]) => [place(t), down(away)]) }));
  }

  function drawMap() {
    const all = [...answer.path, ...answer.gps];
    if (all.length < 2) return map.replaceChildren();
    const [n, e] = [0, 1].map((k) => all.map((row) => row[k]));
    const [n0, n1, e0, e1] = [Math.min(...n), Math.max(...n), Math.min(...e), Math.max(...e)];
    const size = 420, scaled = (size - 40) / Math.max(n1 - n0, e1 - e0, 1);
    const at = ([north, east]) => [size / 2 + scaled * (east - (e0 + e1) / 2), size / 2 - scaled * (north - (n0 + n1) / 2)];
    return map.replaceChildren(el("figure", { class: "picture of-map" },
      svg("svg", { class: "chart map", viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": "The paths from above, north up" },
        svg("polyline", { class: "gps", points: points(answer.gps, at) }),
        svg("polyline", { class: "estimate", points: points(answer.path, at) }), scaleBar(scaled)),
      el("figcaption", {}, "From above, north up: ", el("span", { class: "of-estimate" }, "the estimate"), " over ", el("span", { class: "of-gps" }, "GPS"), ".")));
  }

  function draw() {
    if (!answer) return;
    drawChart();
    if (drawing) return;
    drawMap();
    const figure = (value) => (value === null ? "-" : value.toFixed(2));
    const against = answer.against === "GPS" ? "" : " The curve above is against GPS, whose own error is in it.";
    table.replaceChildren(cuts.length ? el("p", { class: "fine" }, `How far off the estimate was without GPS, against ${answer.against}.${against}`) : "", cuts.length ? el("table", {},
      el("thead", {}, el("tr", {}, ["GPS cut [s]", "rms [m]", "max [m]", ""].map((text) => el("th", { scope: "col" }, text)))),
      el("tbody", {}, cuts.map(([a, b], k) => {
        const cut = answer.outages.find((one) => one.t0 === a && one.t1 === b);
        return el("tr", {}, el("td", {}, `${a} to ${b}`), el("td", {}, cut ? figure(cut.horizontal_rms_m) : "..."),
          el("td", {}, cut ? figure(cut.horizontal_max_m) : "..."),
          el("td", {}, button("Undo", () => setCuts(cuts.filter((_, one) => one !== k)), { "aria-label": `Undo the cut from ${a} s` })));
      }))) : el("p", {}, "Draw along the timeline to cut GPS there, or give the seconds."));
    same.replaceChildren(command(answer.command),
      button("Keep this as a record with its report", () => start("replay", { files: [name], ...question() })));
  }

  chart.addEventListener("pointerdown", (event) => {
    if (!answer) return;
    chart.setPointerCapture(event.pointerId);
    drawing = [time(event), time(event)];
  });
  chart.addEventListener("pointermove", (event) => { if (drawing) { drawing[1] = time(event); drawChart(); } });
  chart.addEventListener("pointerup", () => {
    if (!drawing) return;
    const [a, b] = [Math.min(...drawing), Math.max(...drawing)];
    drawing = null;
    if (b - a >= LEAST_S) setCuts([...cuts, [a, b]]); else drawChart();
  });
  chart.addEventListener("pointercancel", () => { drawing = null; draw(); });
  const add = button("Cut", () => {
    const [a, b] = [Number(from.input.value), Number(to.input.value)];
    if (b > a) setCuts([...cuts, [a, b]]); else status.textContent = "the cut ends before it begins; give other seconds";
  });

  main.replaceChildren(el("h1", {}, "Cut GPS"),
    el("p", { class: "actions" }, el("label", {}, "Log ", pick), status),
    el("p", { class: "fine" }, "How far the estimate is from GPS over the flight. Draw along it where GPS is to be missing."), chart,
    el("p", { class: "actions" }, from.box, to.box, add, button("Undo all", () => setCuts([]))), table,
    el("div", { class: "sliders" }, el("label", {}, flow, " Fuse the optical flow"), scale.map(({ box }) => box), delay.box), map, same);

  const sized = new ResizeObserver(() => { if (answer) drawChart(); });
  sized.observe(chart);
  const unfollow = follow(({ files }) => {
    const able = files.filter((file) => file.look && file.look.replayable && file.look.has_gps).map((file) => file.name);
    if (able.join("/") !== [...pick.options].map((option) => option.value).join("/")) {
      pick.replaceChildren(...able.map((each) => el("option", { value: each }, each)));
    }
    if (!able.length) status.textContent = "Drop in a log with GPS first.";
    if (able.length && !able.includes(name)) choose(able[0]);
    else if (able.length && !answer && !busy && !status.textContent) choose(name);
    pick.value = name;
  });
  return () => { sized.disconnect(); unfollow(); };
}
