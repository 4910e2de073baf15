import { el } from "./dom.js";

export function show(main) { main.replaceChildren(el("p", {}, "This page is not built yet.")); }
