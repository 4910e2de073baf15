// Puts the record's page together: unpacks the data, draws what is in sight first, and moves the instant.
"use strict";
(async () => {
  const root = document.documentElement;
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const { charts, views, facts, columns: packed } = read("record-data");
  const PAPER_WIDTH_PX = 660;
  const hosts = [...document.querySelectorAll("[data-figure]")];
  flight.facts = facts;
  flight.t = facts.start;

  function say(host, words) {
    host.classList.add("words");
    host.replaceChildren(panels.make("p", "absent", words));
    host.dataset.drawn = "words";
  }

  let columns = [];
  try {
    columns = await flight.unpack(document.getElementById("record-columns").textContent, packed);
  } catch (error) {
    for (const host of hosts) say(host, `This browser cannot unpack the page's data (${error.message}); a newer one can.`);
    root.dataset.figures = "drawn";
    return;
  }

  const own = (track) => ({ ...track, t: columns[track.t], n: columns[track.n], e: columns[track.e], d: columns[track.d] });
  const data = views && { ...views, tracks: views.tracks.map(own), gps: views.gps && own(views.gps) };
  const shown = new Map();
  for (const host of hosts) {
    const key = host.dataset.figure;
    if (charts[key]) shown.set(host, new panels.Panel(host, charts[key], columns));
    else if (data && key === "path-3d") shown.set(host, new paths.Space(host, data));
    else if (data) shown.set(host, new paths.Track(host, data, document.getElementById("track-buttons")));
  }

  let drawing = 0;
  async function drawAll() {
    if (root.classList.contains("paper")) return; // it was drawn for the printer, and will be drawn again after that
    const mine = ++drawing;
    delete root.dataset.figures;
    const sight = innerHeight * 1.5;
    const order = [...shown.keys()].sort((a, b) => (a.getBoundingClientRect().top < sight ? 0 : 1) - (b.getBoundingClientRect().top < sight ? 0 : 1));
    let late = performance.now();
    for (const host of order) {
      if (mine !== drawing) return;
      try {
        shown.get(host).draw();
      } catch (error) {
        console.error(error);
        say(host, `This figure could not be drawn: ${error.message}`);
        shown.delete(host);
      }
      if (!root.dataset.firstFigure) root.dataset.firstFigure = performance.now().toFixed(0);
      if (performance.now() - late > 40) {
        await new Promise((resume) => setTimeout(resume)); // the page stays alive between figures
        late = performance.now();
      }
    }
    if (!root.dataset.lastFigure) root.dataset.lastFigure = performance.now().toFixed(0);
    root.dataset.figures = "drawn";
  }

  flight.followers.push((t) => { for (const one of shown.values()) if (one.plots === undefined || one.plots.length) one.follow(t); });
  flight.fitters.push(() => { for (const one of shown.values()) if (one.plots && one.plots.length) one.fit(); });

  // The scrubber: a slider over the phases, play, speed, and the whole flight again.
  const slider = document.getElementById("scrub");
  const said = document.getElementById("scrub-said");
  const play = document.getElementById("scrub-play");
  const speed = document.getElementById("scrub-speed");
  const whole = document.getElementById("scrub-whole");
  const main = data && data.tracks[data.tracks.length - 1];
  const rate = (t, axis) => (flight.between(main.t, main[axis], t + 0.2) - flight.between(main.t, main[axis], t - 0.2)) / 0.4;
  function follow(t) {
    slider.value = t;
    const phase = flight.phaseAt(t);
    const words = [`${t.toFixed(2)} s`, ...(phase ? [phase.name] : [])];
    slider.setAttribute("aria-valuetext", words.join(", "));
    if (main) {
      const down = flight.between(main.t, main.d, t);
      words.push(`height ${(-down).toFixed(2).replace("-", "\u2212")} m`, `speed ${Math.hypot(rate(t, "n"), rate(t, "e"), rate(t, "d")).toFixed(2)} m/s`);
    }
    said.textContent = words.join("  \u00b7  ");
  }
  const band = document.getElementById("scrub-phases");
  for (const phase of facts.phases) {
    const part = panels.make("span", "");
    part.style.left = `${(100 * (phase.t0 - facts.t0)) / (facts.t1 - facts.t0 || 1)}%`;
    part.style.width = `${(100 * (phase.t1 - phase.t0)) / (facts.t1 - facts.t0 || 1)}%`;
    part.style.background = `var(--phase-${phase.name})`;
    part.title = phase.name;
    band.append(part);
  }
  flight.followers.push(follow);
  flight.fitters.push((zoom) => { whole.hidden = !zoom; });
  slider.addEventListener("input", () => flight.setInstant(Number(slider.value)));
  slider.addEventListener("keydown", (event) => {
    const far = { PageUp: 5, PageDown: -5 }[event.key] || (event.shiftKey && { ArrowRight: 1, ArrowLeft: -1, ArrowUp: 1, ArrowDown: -1 }[event.key]);
    if (!far) return;
    event.preventDefault();
    flight.setInstant(flight.t + far);
  });
  whole.addEventListener("click", () => flight.setZoom(null));

  let playing = 0;
  function step(now) {
    if (!playing) return;
    const next = flight.t + (Math.min(200, now - playing) / 1000) * Number(speed.value);
    playing = now;
    flight.setInstant(next);
    if (next >= facts.t1) stop();
    else requestAnimationFrame(step);
  }
  function stop() {
    playing = 0;
    play.textContent = "\u25b6";
    play.setAttribute("aria-label", "Play");
  }
  play.addEventListener("click", () => {
    if (playing) return stop();
    if (flight.t >= facts.t1 - 1e-6) flight.setInstant(facts.t0);
    playing = performance.now();
    play.textContent = "\u275a\u275a";
    play.setAttribute("aria-label", "Pause");
    requestAnimationFrame(step);
  });

  // A table's instants move the page there; a panel's button saves its data.
  for (const cell of document.querySelectorAll("[data-goto]")) cell.addEventListener("click", () => flight.setInstant(Number(cell.dataset.goto)));
  for (const button of document.querySelectorAll("[data-csv]")) {
    button.addEventListener("click", () => {
      const host = hosts.find((one) => one.dataset.figure === button.dataset.csv);
      const link = document.createElement("a");
      link.href = URL.createObjectURL(new Blob([shown.get(host).csv()], { type: "text/csv" }));
      link.download = `${facts.name}-${button.dataset.csv}.csv`.replace(/[^\w.-]+/g, "-");
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }

  let width = innerWidth;
  addEventListener("resize", () => {
    if (innerWidth === width) return;
    width = innerWidth;
    drawAll();
  });
  prefersDark.addEventListener("change", drawAll);
  let closed = [];
  addEventListener("beforeprint", () => {
    root.classList.add("paper");
    closed = [...document.querySelectorAll("details:not([open])")];
    for (const part of closed) part.open = true;
    for (const [host, one] of shown) one.draw(PAPER_WIDTH_PX, one.plots ? undefined : host.clientHeight);
  });
  addEventListener("afterprint", () => {
    root.classList.remove("paper");
    for (const part of closed) part.open = false;
    drawAll();
  });
  follow(flight.t);
  drawAll();
})();
