// A requirement as a form: its plan, its flights, its verdict and the certificate.

import { act, fileUrl, follow, post, request, start, state } from "./ask.js";
import { button, command, el, notice } from "./dom.js";

const SHIPPED = [["landing", "The paper's landing"], ["takeoff", "The paper's take-off"], ["pad_return", "Back to the pad on GPS and flow"],
  ["approach", "Approach with a pad camera"], ["approach_8_m_s", "The same approach in 8 m/s of wind"], ["", "A requirement of your own"]];
const MEASURES = [["touchdown.rest_m", "distance from the pad's centre at rest [m]"], ["touchdown.horizontal_m", "distance at the first contact [m]"],
  ["touchdown.sink_rate_m_s", "sink rate at first contact [m/s]"]];
const SCENARIOS = [["approach", "approach with a pad camera"], ["pad_return", "back to the pad"], ["landing", "landing"]];

const choice = (title, rows, onchange) => {
  const input = el("select", { onchange }, rows.map(([value, text]) => el("option", { value }, text)));
  return { input, box: el("label", {}, title, input) };
};
const field = (title, value, min, max) => {
  const input = el("input", { type: "number", step: "any", value, min, max });
  return { input, box: el("label", {}, title, input) };
};

// A requirement's sentence with what is measured in words in place of its name.
const inWords = (sentence, words) => sentence.replace(/^[a-z]+\.[a-z_]+/, words);
const lasting = (seconds) => (seconds < 90 ? `${seconds} s` : `${Math.round(seconds / 60)} minutes`);

export function show(main) {
  const own = el("div", { class: "form" }), plan = el("div", { class: "scroll" }), run = el("div");
  const which = choice("Requirement", SHIPPED, () => { own.hidden = Boolean(which.input.value); planned = null; plan.replaceChildren(); });
  const scenario = choice("Scenario", SCENARIOS), measure = choice("Measure", MEASURES);
  const most = field("at most", 0.5, 0, 100), share = field("with probability [%]", 95, 1, 99.99);
  const sure = field("shown with confidence [%]", 90, 1, 99.99), wind = field("wind at 20 ft [m/s]", 4, 0, 20);
  own.append(...[scenario, measure, most, share, sure, wind].map(({ box }) => box));
  own.hidden = true;
  let planned = null, flown = null, timer = 0, left = false, paced = null;
  const pace = el("p", { role: "status" });

  async function requirement() {
    if (which.input.value) return which.input.value;
    const found = await post("api/requirement", {
      scenario: scenario.input.value, measure: measure.input.value, at_most: Number(most.input.value),
      probability: Number(share.input.value) / 100, confidence: Number(sure.input.value) / 100, wind_m_s: Number(wind.input.value),
    });
    return found.name;
  }
  async function begin(more) {
    try {
      const job = await start("certify", { requirement: await requirement(), ...more });
      if (job && more.plan) planned = job.number;
      else if (job) { flown = job.number; watch(); }
      draw();
    } catch (error) { notice(error.message); }
  }
  const find = (number) => state.jobs.find((job) => job.number === number);

  function drawPlan(job) {
    if (!job) return;
    const facts = job.facts;
    if (!facts) { plan.replaceChildren(el("p", {}, job.message || "is planned ...")); return; }
    plan.replaceChildren(el("p", {}, `${facts.flights} flights are needed.`), el("table", {},
      el("thead", {}, el("tr", {}, ["requirement", `may fail, of ${facts.flights}`].map((text) => el("th", { scope: "col" }, text)))),
      el("tbody", {}, facts.requirements.map((row) => el("tr", {}, el("td", {}, inWords(row.requirement, row.words)),
        el("td", {}, String(row.allowed_of_all)))))), pace, command(job.command));
    askPace(job);
  }

  // How long the flights of a plan take on this machine, from some that are flown for it.
  async function askPace(job) {
    if (paced === job.number) return;
    paced = job.number;
    pace.textContent = "Some flights are flown to see how long all of them take ...";
    let line;
    try {
      const found = await post("api/ask", { what: "pace", requirement: job.command.split(" ")[2] });
      line = `To fly and judge takes about ${lasting(found.seconds)} on this machine: ${found.flights} flights with the check and the ranking of the inputs.`;
    } catch (error) { line = error.message; }
    if (paced === job.number) pace.textContent = line;
  }

  async function watch() {
    clearTimeout(timer);
    const job = find(flown);
    if (!job || left) return;
    const running = ["queued", "running"].includes(job.state);
    if (!running) return drawRun(job, "");
    let line = "is flown ...";
    try {
      const found = await post("api/ask", { what: "cloud", file: job.writes });
      const passed = Date.now() / 1e3 - job.since_s, rest = found.flights ? passed * (found.planned - found.flights) / found.flights : null;
      line = `${found.flights} of ${found.planned} flights${rest === null ? "" : `, about ${lasting(Math.ceil(rest))} more`}`;
    } catch { /* its folder is not there yet */ }
    drawRun(job, line);
    timer = setTimeout(watch, 1500);
    return null;
  }

  function drawRun(job, line) {
    if (left) return;
    const facts = job.facts || {};
    const rows = facts.requirement?.requirements || [];
    run.replaceChildren(el("h2", {}, "Certificate"),
      line ? el("p", { role: "status" }, line, " ", button("Stop", () => act(() => request(`api/jobs/${job.number}`, { method: "DELETE" })).then(watch)))
        : el("p", { class: "big", role: "status" }, facts.verdict || job.message || job.state),
      el("ul", {}, rows.map((row) => el("li", {}, `${row.verdict}: ${inWords(row.sentence, row.words)} (${row.failures} of ${row.flights} failed)`))),
      facts.verdict ? el("p", {}, el("a", { href: fileUrl(`${job.writes}/certificate.html`), target: "_blank", rel: "noopener" }, "Open the certificate")) : "",
      job.state === "cancelled" ? button("Go on", () => begin({ folder: job.writes })) : "", command(job.command));
  }
  const draw = () => drawPlan(find(planned));

  main.replaceChildren(el("h1", {}, "Certify"), el("div", { class: "form" }, which.box, own),
    el("p", { class: "actions" }, button("Plan", () => begin({ plan: true })), button("Fly and judge", () => begin({}), { class: "main" })), plan, run);
  const unfollow = follow(() => {
    draw();
    if (!flown) flown = [...state.jobs].reverse().find((job) => job.kind === "certify" && job.writes)?.number || null;
    watch();
  });
  return () => { left = true; clearTimeout(timer); unfollow(); };
}
