// Live: what to type for now; a session's record is opened under Logs.

import { command, el } from "./dom.js";

export function show(main) {
  main.replaceChildren(el("h1", {}, "Live"),
    el("p", {}, "A live session runs in a terminal, where its screen shows quality, protection level, what is sent, and why it withholds. This page does not show a session yet."),
    command("flownav live udp:14540 --record flight.fnr"),
    el("p", {}, "Drop its record under Logs when it has ended."));
}
