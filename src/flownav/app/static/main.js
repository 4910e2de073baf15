// The pages by the part of the address behind #, and what stands on all of them.

import { follow, refresh } from "./ask.js";
import { el, notice } from "./dom.js";
import "./jobs.js";

const PAGES = { logs: "./logs.js", cut: "./cut.js", fly: "./fly.js", certify: "./certify.js", live: "./live.js" };
const TITLES = { logs: "Logs", cut: "Cut GPS", fly: "Fly", certify: "Certify", live: "Live" };
let leave = () => {}, asked = 0;

async function show() {
  const [page, ...rest] = location.hash.slice(1).split("/");
  const name = page in PAGES ? page : "logs";
  const turn = ++asked;
  const module = await import(PAGES[name]);
  if (turn !== asked) return;
  leave();
  const main = document.getElementById("main");
  document.title = `${TITLES[name]} · flownav`;
  for (const link of document.querySelectorAll("nav a")) {
    if (link.getAttribute("href") === `#${name}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  leave = module.show(main, decodeURIComponent(rest.join("/"))) || (() => {});
}

addEventListener("hashchange", show);
addEventListener("unhandledrejection", (event) => notice(event.reason?.message || String(event.reason)));
follow((state) => document.getElementById("folder").replaceChildren(state.folder));
document.getElementById("main").append(el("p", {}, "..."));
await refresh();
await show();
document.documentElement.dataset.ready = "yes";
