// Live sessions: the path, quality, protection level, what is sent, and in red why it is not.

import { act, follow, request, start, state } from "./ask.js";
import { button, command, el } from "./dom.js";
import { whole } from "./live_map.js";

const SENDS = [["none", "nothing: only listen, and record"], ["odometry", "position, velocity and attitude (ODOMETRY)"],
  ["vision", "position and velocity (VISION_POSITION_ESTIMATE)"], ["landing-target", "the pad's place (LANDING_TARGET)"]];
const EVERY_MS = 500, OLD_S = 4;
const PORT = 14550;

export function show(main) {
  let left = false, timer = 0, trial = null, lost = "";
  const shown = new Map();
  const sessions = el("div"), waiting = el("p", { role: "status" });
  const form = startForm(begin);

  async function begin(asked, vehicle) {
    const job = await start("live", asked);
    if (job && vehicle) trial = job.number;
    look();
  }

  async function look() {
    clearTimeout(timer);
    if (left) return;
    let found = [];
    try {
      found = (await request("api/live")).sessions;
      lost = "";
    } catch (error) {
      lost = error.message;
    }
    if (left) return;
    draw(found);
    const listens = found.find((one) => one.job !== null && one.job === trial);
    if (listens) { trial = null; start("vehicle", { port: PORT }); }
    timer = setTimeout(look, EVERY_MS);
  }

  function draw(found) {
    const names = found.map((one) => one.name);
    for (const [name, card] of shown) if (!names.includes(name) && !lost) { card.node.remove(); shown.delete(name); }
    for (const one of found) {
      if (!shown.has(one.name)) { shown.set(one.name, sessionCard()); sessions.append(shown.get(one.name).node); }
      shown.get(one.name).draw(one);
    }
    if (lost) for (const card of shown.values()) card.lose(lost);
    const begun = state.jobs.find((job) => job.kind === "live" && ["queued", "running"].includes(job.state) && !found.some((one) => one.job === job.number));
    waiting.textContent = !begun ? "" : begun.ending ? "The session ends and writes its record ..." : `The session begins ... ${begun.message}`;
    waiting.hidden = !begun;
    const runs = found.some((one) => one.age_s < OLD_S);
    if (runs !== form.runs) { form.runs = runs; form.node.open = !runs && !begun; }
  }

  main.replaceChildren(el("h1", {}, "Live"), sessions, waiting, form.node);
  const unfollow = follow(form.sensors);
  look();
  return () => { left = true; clearTimeout(timer); unfollow(); };
}

// -- what begins a session ----------------------------------------------------------------------------------------
function startForm(begin) {
  const url = el("input", { type: "text", value: `udp:${PORT}`, list: "links", spellcheck: "false", autocomplete: "off" });
  const links = el("datalist", { id: "links" }, ["udp:14550", "udp:14540", "serial:/dev/ttyACM0", "serial:/dev/ttyUSB0:921600", "tcp:127.0.0.1:5762"].map((value) => el("option", { value })));
  const send = el("select", {}, SENDS.map(([value, text]) => el("option", { value }, text)));
  const sensor = el("select", {}, el("option", { value: "" }, "none"));
  const delay = field(0.22, 0, 1, 0.01), limit = field(1.5, 0.1, 60, 0.1), protection = field(20, 0.01, 1000, 0.5);
  const asked = () => ({ url: url.value.trim(), send: send.value, sensor: sensor.value, gps_delay: Number(delay.value),
    send_limit: Number(limit.value), send_protection: Number(protection.value) });
  const node = el("details", { class: "begin" }, el("summary", {}, "Start a session"),
    el("div", { class: "form" },
      el("label", {}, "Link to the vehicle", url), links,
      el("p", { class: "fine" }, "udp:PORT listens on this machine; serial:DEVICE:BAUD is a port; tcp:HOST:PORT calls."),
      el("label", {}, "What is sent to the vehicle", send),
      el("label", {}, "Flow sensor's file, from Identify", sensor),
      el("label", {}, "GPS delay [s]", delay),
      el("label", {}, "Send no longer than this without GPS or flow [s]", limit),
      el("label", {}, "Send while the protection level is below [m]", protection),
      el("p", { class: "actions" }, button("Start", () => begin(asked(), false), { class: "main" }),
        button("Try it with a simulated vehicle", () => begin({ url: `udp:${PORT}`, send: "odometry", gps_delay: 0.12 }, true)))));
  node.open = true;
  const sensors = ({ files }) => {
    const names = files.filter((file) => file.kind === "sensor").map((file) => file.name), chosen = sensor.value;
    if (names.length + 1 === sensor.options.length) return;
    sensor.replaceChildren(...["", ...names].map((value) => el("option", { value }, value || "none")));
    sensor.value = chosen;
  };
  return { node, sensors, runs: null };
}

const field = (value, min, max, step) => el("input", { type: "number", value, min, max, step });

// -- a session ----------------------------------------------------------------------------------------------------
function sessionCard() {
  const alarm = el("p", { role: "alert" }), since = el("p", { class: "fine" }), stop = el("p", { class: "actions" });
  const tiles = el("dl", { class: "tiles" }), map = el("figure", { class: "picture of-map" }), sensors = el("div", { class: "scroll" });
  const more = el("details", {}, el("summary", {}, "More figures")), lines = el("ul", { class: "plain fine" }), title = el("h2");
  more.append(sensors, lines);
  const node = el("section", { class: "session", "aria-label": "Live session" }, title, alarm, since, stop, tiles, map, more);
  let said = "", stopped = null;

  // The words change only where they differ, so that they are read out once.
  function say(words, kind) {
    if (words === said) return;
    said = words;
    alarm.className = kind;
    alarm.textContent = words;
  }

  function draw({ name, age_s, job, state: now }) {
    node.dataset.session = name;
    const running = state.jobs.find((each) => each.number === job);
    title.textContent = now.vehicle ? `Vehicle ${now.vehicle.system}.${now.vehicle.component} on ${now.url}` : now.url;
    const [words, kind] = verdict(age_s, now);
    say(words, kind);
    since.textContent = age_s > OLD_S ? gone(job, now, age_s)
      : [now.reason ? `For ${seconds(now.for_s)}.` : "", `Runs for ${seconds(now.lasted_s)}.`, now.record ? `Its record: ${now.record}.` : ""].join(" ");
    if (stopped !== `${job} ${running?.ending}`) {
      stopped = `${job} ${running?.ending}`;
      stop.replaceChildren(running ? button("Stop the session", () => act(() => request(`api/jobs/${job}`, { method: "DELETE" }))) : "");
      if (running?.ending) stop.firstElementChild.disabled = true;
    }
    tiles.replaceChildren(...figures(now));
    map.replaceChildren(...whole(now));
    drawSensors(now);
    lines.replaceChildren(...[...now.lines.filter(Boolean), ...Object.entries(now.withheld).map(([why, count]) => `withheld ${count} times: ${why}`)].map((text) => el("li", {}, text)),
      el("li", {}, running ? command(running.command) : ""));
  }

  function drawSensors({ sensors: rows, alarms }) {
    const heads = ["sensor", "Hz", "age [s]", "lag [s]", "innovation", "ratio", "refused for"];
    sensors.replaceChildren(...alarms.map((text) => el("p", { class: "alert" }, text)), el("table", {},
      el("thead", {}, el("tr", {}, heads.map((text) => el("th", { scope: "col" }, text)))),
      el("tbody", {}, rows.map((row) => el("tr", {}, row.map((text) => el("td", {}, text.replaceAll("_", " "))))))));
  }
  return { node, draw, lose: (why) => say(why, "reason") };
}

function verdict(age_s, now) {
  if (age_s > OLD_S) return ["There is no news from the session.", "reason"];
  if (now.reason) return [`${now.velocity_only ? "Only the velocity is sent" : "Nothing is sent"}: ${now.why}.`, "reason"];
  const alarm = now.alarms[0] ? ` ${now.alarms[0]}` : "";
  if (now.listens) return [`It only listens; the estimate could be sent.${alarm}`, alarm ? "reason" : "sends"];
  return [`The estimate is sent.${alarm}`, alarm ? "reason" : "sends"];
}

// What to do about a session that is silent.
function gone(job, now, age_s) {
  const last = `Its state was written ${seconds(age_s)} ago. `;
  if (job !== null) return `${last}The session runs; this machine may be overloaded.`;
  const how = now.record ? ` Its journal becomes a record: flownav recover ${now.record}.journal` : "";
  return `${last}The session was ended without notice.${how}`;
}

const seconds = (value) => (value < 100 ? `${Math.round(value)} s` : `${Math.floor(value / 60)} min ${Math.round(value % 60)} s`);
const metres = (value) => (value === null || value === undefined ? "-" : `${value.toFixed(value < 10 ? 2 : 1)} m`);

function figures(now) {
  const tile = (name, value, words) => el("div", {}, el("dt", {}, name), el("dd", {}, el("span", { class: "big" }, value), el("small", {}, words)));
  const spread = now.three_sigma_m ? Math.max(now.three_sigma_m[0], now.three_sigma_m[1]) : null;
  const speed = now.vel_ned_m_s ? Math.hypot(now.vel_ned_m_s[0], now.vel_ned_m_s[1]) : null;
  return [
    tile("Quality", now.quality_percent === null ? "-" : `${now.quality_percent} %`, "what is left to the nearest limit"),
    tile("Protection level", metres(now.protection_m?.[0]), now.suspected ? `suspected: ${now.suspected}` : `horizontal; nothing is sent beyond ${metres(now.limits.protection_m)}`),
    tile("Height", metres(now.here_ned_m ? -now.here_ned_m[2] + 0 : null), now.protection_m ? `protection level ${metres(now.protection_m[1])}` : "above the start"),
    tile("Position ± 3σ", metres(spread), "horizontal"),
    tile("Speed", speed === null ? "-" : `${speed.toFixed(2)} m/s`, "horizontal"),
    tile("Estimates sent", String(now.sent), now.send === "none" ? "only listens" : now.send),
  ];
}
