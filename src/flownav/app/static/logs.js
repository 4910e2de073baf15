// The logs of the folder: drop them in, see what each is, and what can be made of it.

import { act, fileUrl, follow, post, start, state } from "./ask.js";
import { button, el, size, thumbnail } from "./dom.js";
import { chosen, dropped, upload } from "./uploads.js";

const AUTOPILOTS = [["", "as the log says"], ["px4", "PX4"], ["ardupilot", "ArduPilot"], ["inav", "INAV"]];
const ticked = new Set();
const uploads = el("ul", { class: "plain uploads" });
const list = el("ul", { class: "plain files" });
const compare = button("Compare the ticked", () => start("compare", { files: [...ticked] }));
const whose = el("select", {}, AUTOPILOTS.map(([value, text]) => el("option", { value }, text)));

function verdict(file) {
  const look = file.look;
  if (!look || !Object.keys(look).length) return el("p", {}, file.looking ? "is looked at ..." : "");
  if (look.error) return el("p", { class: "alert" }, look.error);
  const lasts = (look.end_s - look.start_s).toFixed(0);
  return el("div", {},
    el("p", { class: look.causes.length ? "verdict alert" : "verdict" }, look.explained),
    el("p", { class: "fine" }, `${lasts} s: ${look.sensors.join(", ").replaceAll("_", " ")}`),
    look.verdict && el("p", { class: "fine" }, look.verdict),
    look.obstacles.map((text) => el("p", { class: "alert" }, `Cannot be replayed: ${text}`)),
    look.warnings.length > 0 && el("details", {}, el("summary", {}, `${look.warnings.length} warnings`),
      el("ul", {}, look.warnings.map((text) => el("li", {}, text)))));
}

function actions(file) {
  const one = { files: [file.name] }, look = file.look || {};
  const autopilot = () => ({ ...one, autopilot: whose.value });
  const read = !look.error && look.explained;
  const kinds = file.kind === "record" ? [button("Report", () => start("report", one))] : [];
  if (read && look.replayable && file.kind === "log") kinds.push(button("Report", () => start("replay", one)));
  if (read) {
    kinds.push(button("Explain", () => start("explain", autopilot())));
    kinds.push(button("Identify", () => start("identify", autopilot())));
  }
  if (read && look.has_gps && look.replayable) {
    kinds.push(el("a", { class: "button", href: `#cut/${encodeURIComponent(file.name)}` }, "Cut GPS"));
  }
  if (file.looking) kinds.push(button("Cancel", () => act(() => post("api/look", { name: file.name, stop: true }))));
  if (look.error) kinds.push(button("Look again", () => act(() => post("api/look", { name: file.name }))));
  kinds.push(button("Remove", () => act(() => post("api/remove", { name: file.name })), {
    title: "Moves it into .flownav-app/removed", "aria-label": `Remove ${file.name}`,
  }));
  return kinds;
}

function row(file) {
  const tick = el("input", { type: "checkbox", "aria-label": `Compare ${file.name}`, onchange: (event) => {
    if (event.target.checked) ticked.add(file.name); else ticked.delete(file.name);
    compare.disabled = ticked.size < 2;
  } });
  tick.checked = ticked.has(file.name);
  const path = file.look && file.look.path;
  const words = path ? `Path of ${file.name}, of ${file.look.path_of}` : "";
  return el("li", { "data-file": file.name },
    thumbnail(path, words),
    el("div", { class: "about" },
      el("h3", {}, el("label", {}, tick, " ", file.name), " ", el("small", {}, size(file.bytes))),
      verdict(file), el("p", { class: "actions" }, actions(file))));
}

function campaignRow(file) {
  return el("li", { "data-file": file.name }, el("div", { class: "thumbnail none" }),
    el("div", { class: "about" }, el("h3", {}, file.name, " ", el("small", {}, "campaign")),
      el("p", { class: "actions" }, el("a", { class: "button", href: `#fly/${encodeURIComponent(file.name)}` }, "Open"))));
}

function sensorRow(file) {
  return el("li", { "data-file": file.name }, el("div", { class: "thumbnail none" }),
    el("div", { class: "about" }, el("h3", {}, file.name, " ", el("small", {}, "flow sensor, which Fly can take")),
      el("p", { class: "actions" }, el("a", { class: "button", href: fileUrl(file.name), download: file.name }, "Download"))));
}

const ROWS = { log: row, record: row, campaign: campaignRow, sensor: sensorRow };

function draw({ files }) {
  const open = new Set([...list.querySelectorAll("details[open]")].map((each) => each.closest("li").dataset.file));
  const focused = document.activeElement;
  const place = list.contains(focused) ? [focused.closest("li").dataset.file, focused.textContent] : null;
  list.replaceChildren(...files.map((file) => ROWS[file.kind](file)));
  for (const each of list.querySelectorAll("details")) each.open = open.has(each.closest("li").dataset.file);
  if (place) {
    const same = [...list.querySelectorAll("li")].find((each) => each.dataset.file === place[0]);
    if (same) [...same.querySelectorAll("button, input, a, summary")].find((each) => each.textContent === place[1])?.focus();
  }
  for (const name of [...ticked]) if (!files.some((file) => file.name === name)) ticked.delete(name);
  compare.disabled = ticked.size < 2;
  compare.hidden = files.filter((file) => ["log", "record"].includes(file.kind)).length < 2;
}

function dropZone() {
  const one = el("input", { type: "file", multiple: true, id: "choose", onchange: () => upload(chosen(one.files), uploads) });
  const folder = el("input", { type: "file", webkitdirectory: true, id: "choose-folder",
    onchange: () => upload(chosen(folder.files), uploads) });
  const zone = el("div", { class: "drop" },
    el("p", {}, "Drop logs or records here: ULog, DataFlash, .tlog, ROS bags, Crazyflie, Blackbox, folders of CSV files, .fnr; up to 500 MB each."),
    el("p", {}, el("label", { class: "button", for: "choose" }, "Choose files"), one, " ",
      el("label", { class: "button", for: "choose-folder" }, "Choose a folder"), folder));
  return zone;
}

// Anywhere on the page, so that a drop beside the zone does not leave the page.
addEventListener("dragover", (event) => { event.preventDefault(); document.body.classList.add("over"); });
addEventListener("dragleave", (event) => { if (!event.relatedTarget) document.body.classList.remove("over"); });
addEventListener("drop", async (event) => {
  event.preventDefault();
  document.body.classList.remove("over");
  if (location.hash.split("/")[0] !== "#logs") location.hash = "#logs";
  upload(await dropped(event.dataTransfer), uploads);
});

export function show(main) {
  main.replaceChildren(el("h1", {}, "Logs"), dropZone(), uploads,
    el("p", { class: "actions" }, compare, el("label", {}, "Parameters for ", whose)), list);
  draw(state);
  return follow(draw);
}
