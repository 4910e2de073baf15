// The jobs of the folder: what runs, what came of it, the files that it wrote, and the command that does the same.

import { act, fileUrl, follow, request } from "./ask.js";
import { button, command, el } from "./dom.js";

const STATES = { queued: "waits", running: "runs", done: "done", failed: "failed", cancelled: "cancelled" };
const TITLES = {
  replay: "Report", report: "Report", explain: "Explain", identify: "Identify", compare: "Compare", fly: "Flight",
  campaign: "Campaign", certify: "Certificate", live: "Live session", vehicle: "Simulated vehicle",
};
const PAGES = ["report", "page", "certificate"], SAVED = ["record", "parameters", "sensor"];

// The files of a job by what they are called.
export function files(job) {
  const facts = job.facts || {};
  const text = (name) => (typeof facts[name] === "string" ? facts[name] : null);
  return {
    pages: PAGES.map(text).filter((name) => name && name.endsWith(".html")),
    saved: SAVED.map(text).filter(Boolean),
  };
}

export function links(job) {
  const { pages, saved } = files(job);
  return [
    ...pages.map((name) => el("a", { href: fileUrl(name), target: "_blank", rel: "noopener" }, "Open the page")),
    ...saved.map((name) => el("a", { href: fileUrl(name), download: name.split("/").pop() }, name.split("/").pop())),
  ];
}

function sentence(job) {
  const facts = job.facts || {};
  if (job.kind === "live" && job.state === "done" && facts.vehicle) {
    return `${facts.duration_s.toFixed(0)} s, ${facts.sent} estimates sent${job.message ? `; ${job.message}` : ""}`;
  }
  if (job.kind === "live" && job.state === "running") return job.ending ? "ends, and writes its record" : job.message;
  return (job.state === "failed" && job.message) || facts.verdict || (facts.findings && facts.findings[0]) || job.message;
}

export function card(job) {
  const running = ["queued", "running"].includes(job.state);
  const title = `${TITLES[job.kind] || job.kind}${job.about.length ? ` of ${job.about.join(", ")}` : ""}`;
  return el("li", { class: `job ${job.state}`, "data-job": job.number },
    el("p", {}, el("strong", {}, title), " ", el("span", { class: "state" }, STATES[job.state]),
      running && el("progress", { "aria-label": `${title} runs` }),
      running && button(job.kind === "live" ? "Stop" : "Cancel", () => act(() => request(`api/jobs/${job.number}`, { method: "DELETE" })))),
    sentence(job) && el("p", { class: "words" }, String(sentence(job))),
    el("p", { class: "links" }, links(job)),
    command(job.command));
}

follow((state) => {
  const place = document.getElementById("jobs");
  place.hidden = !state.jobs.length;
  const newest = [...state.jobs].reverse();
  place.replaceChildren(el("h2", {}, "Jobs"), el("ul", { class: "plain" }, newest.slice(0, 12).map(card)));
});
