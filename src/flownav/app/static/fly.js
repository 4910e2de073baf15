// A landing flown with sliders: its picture moves as they do; "fly 200" grows a cloud of touchdowns.

import { act, fileUrl, follow, post, request, start, state } from "./ask.js";
import { button, command, el, picture } from "./dom.js";

const SCENARIOS = [["landing", "Landing"], ["pad_return", "Back to the pad"], ["approach", "Approach with a pad camera"],
  ["gusty", "Gusty wind"], ["takeoff", "Take-off"], ["sortie", "The whole mission"]];
const GPS = [["", "as the scenario says"], ["white", "white noise, as in the paper"], ["midg", "a receiver of 2 m CEP"]];
const VEHICLES = [["", "as the scenario says"], ["maxi-joker-3", "Maxi Joker 3 helicopter"], ["quad-450", "quadrotor, 450 mm"],
  ["hexa-550", "hexarotor, 550 mm"]];
const FLIGHTS = 200;

export function show(main, opened) {
  let busy = false, again = false, folder = opened || "", number = null, timer = 0, left = false;
  const choice = (title, rows) => {
    const input = el("select", { onchange: fly }, rows.map(([value, text]) => el("option", { value }, text)));
    return { input, box: el("label", {}, title, input) };
  };
  const range = (title, min, max, step, value) => {
    const out = el("output", {}, String(value));
    const input = el("input", { type: "range", min, max, step, value, oninput: () => { out.value = input.value; fly(); } });
    return { input, box: el("label", {}, title, out, input) };
  };
  const scenario = choice("Scenario", SCENARIOS), gps = choice("GPS", GPS), vehicle = choice("Vehicle", VEHICLES);
  const sensor = choice("Flow sensor", [["", "as the scenario says"]]);
  const wind = range("Wind at 20 ft [m/s]", 0, 12, 0.5, 4), direction = range("Wind from [deg]", 0, 355, 5, 270);
  const seed = range("Seed of the noise", 1, 100, 1, 1);
  const status = el("p", { role: "status" }), shown = el("div"), same = el("div"), many = el("div"), cloud = el("div");
  const asked = () => ({
    scenario: scenario.input.value, gps: gps.input.value, vehicle: vehicle.input.value, sensor: sensor.input.value,
    wind: `${wind.input.value}:${direction.input.value}`, seed: Number(seed.input.value),
  });

  async function fly() {
    if (busy) { again = true; return; }
    busy = true;
    status.textContent = state.saying || "flies ...";
    shown.firstElementChild?.classList.add("waits");
    try {
      const found = await post("api/ask", { what: "fly", ...asked() });
      shown.replaceChildren(picture(found.svg, found.words));
      same.replaceChildren(command(found.command), button("Keep this flight with its report", () => start("fly", asked())));
      status.textContent = found.crashed ? "It crashed." : found.reason ? `${found.verdict}: ${found.reason}` : found.verdict;
    } catch (error) {
      status.textContent = error.message;
    }
    busy = false;
    if (again && !left) { again = false; fly(); }
  }

  async function begin() {
    const job = await start("campaign", folder ? { ...resumed(), folder } : { ...asked(), flights: FLIGHTS });
    if (job) { number = job.number; folder = job.writes; follow_cloud(); }
  }
  // A campaign goes on by the words that began it; after a restart of the page its plan is that of the sliders.
  const resumed = () => JSON.parse(sessionStorage.getItem(`campaign ${folder}`) || "null") || { ...asked(), flights: FLIGHTS };

  async function follow_cloud() {
    clearTimeout(timer);
    if (!folder || left) return;
    sessionStorage.setItem(`campaign ${folder}`, JSON.stringify(resumed()));
    const job = state.jobs.find((each) => each.number === number)
      || [...state.jobs].reverse().find((each) => each.kind === "campaign" && each.writes === folder);
    const running = job && ["queued", "running"].includes(job.state);
    try {
      const found = await post("api/ask", { what: "cloud", file: folder });
      const ring = found.r95_m === null ? "no R95 yet" : `R95 ${(100 * found.r95_m).toFixed(1)} cm`;
      const line = `${found.flights} of ${found.planned} flights, ${found.landed} landed, ${ring}`;
      cloud.replaceChildren(el("p", { role: "status" }, line), el("progress", { value: found.flights, max: found.planned, "aria-label": line }),
        found.svg ? picture(found.svg, found.words) : "");
      drawMany(running, found.flights < found.planned, job);
    } catch (error) {
      if (!running) cloud.replaceChildren(el("p", {}, error.message));
      drawMany(running, true, job);
    }
    if (running) timer = setTimeout(follow_cloud, 1200);
  }

  function drawMany(running, unfinished, job) {
    many.replaceChildren(el("p", { class: "actions" },
      running ? button("Stop", () => act(() => request(`api/jobs/${job.number}`, { method: "DELETE" })).then(follow_cloud))
        : button(folder && unfinished ? "Go on" : `Fly ${FLIGHTS}`, () => { if (!unfinished) folder = ""; begin(); }, { class: "main" }),
      !running && folder && unfinished && button(`Fly ${FLIGHTS} with these sliders`, () => { folder = ""; begin(); }),
      !running && folder && !unfinished && el("a", { href: fileUrl(`${folder}/report.html`), target: "_blank", rel: "noopener" }, "Open the campaign's page")),
    job ? command(job.command) : "");
  }

  main.replaceChildren(el("h1", {}, "Fly"),
    el("div", { class: "sliders" }, [scenario, vehicle, gps, sensor, wind, direction, seed].map(({ box }) => box)),
    status, shown, same, el("h2", {}, "Many flights"),
    el("p", { class: "fine" }, "Each flight draws its own vehicle, wind and sensors about their datasheets; what has flown is kept."), many, cloud);
  if (!folder) drawMany(false, false, null);
  fly();
  follow_cloud();
  const unfollow = follow(({ files }) => {
    const sheets = files.filter((file) => file.kind === "sensor").map((file) => file.name);
    const chosen = sensor.input.value;
    if (sheets.length + 1 !== sensor.input.options.length) {
      sensor.input.replaceChildren(...[["", "as the scenario says"], ...sheets.map((each) => [each, each])].map(([value, text]) => el("option", { value }, text)));
      sensor.input.value = chosen;
    }
  });
  return () => { left = true; clearTimeout(timer); unfollow(); };
}
