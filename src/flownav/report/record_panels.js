// Panels over time: rows of uPlot axes that share the page's instant and zoom, with labels at the ends of their lines.
"use strict";
const panels = (() => {
  const GUTTER_PX = 112;
  const LEFT_PX = 58;
  const BOTTOM_PX = 26;
  const TITLE_PX = 18;
  const STRIP_PX = 5;
  const NAMES_PX = 15;
  const DASHES = { truth: [5, 3], command: [2, 3], gate: [6, 4] };
  const WIDTHS = { truth: 1.3, estimate: 1.6, gps: 1.5, flow: 1.5 };
  const FONT = (px) => `${px}px ${flight.colour("font")}`;
  // A number beside an axis: a tiny one whose zeros would not fit there as a power of ten.
  const short = (value) => (String(value).length > 7 && Math.abs(value) < 1e-3 ? value.toExponential() : String(value));
  const make = (tag, name, text = "") => Object.assign(document.createElement(tag), { className: name, textContent: text });

  class Panel {
    constructor(host, spec, columns) {
      this.host = host;
      this.spec = spec;
      const own = (one) => ({ ...one, t: columns[one.t], v: columns[one.v], m: one.m === undefined ? null : columns[one.m] });
      this.rows = spec.rows.map((row) => {
        const series = row.series.map(own);
        return { ...row, series, lines: series.filter((one) => one.kind === "line" || one.kind === "band") };
      });
      this.plots = [];
    }

    // The visible window: the page's zoom; of a close-up the part of it in its own stretch, or else all of that.
    window() {
      const own = this.spec.window;
      const { zoom } = flight;
      if (!zoom || !own) return zoom || own || [flight.facts.t0, flight.facts.t1];
      const both = [Math.max(zoom[0], own[0]), Math.min(zoom[1], own[1])];
      return both[1] > both[0] ? both : own;
    }

    draw(width = 0, height = this.spec.height) {
      for (const plot of this.plots) plot.destroy();
      this.plots = [];
      this.host.replaceChildren();
      this.width = width || this.host.clientWidth;
      this.gutter = this.width >= 460 ? GUTTER_PX : 0;
      this.colours = new Map();
      const named = new Set();
      this.rows.forEach((row, k) => this.drawRow(row, k, height, named));
      this.host.dataset.drawn = "figure";
    }

    colour(role) {
      if (!this.colours.has(role)) this.colours.set(role, flight.colour(role));
      return this.colours.get(role);
    }

    drawRow(row, k, height, named) {
      const last = k + 1 === this.rows.length;
      const box = make("div", "row");
      const head = make("div", "row-title", row.title);
      row.labels = new Map();
      row.box = box;
      const chips = make("div", this.gutter ? "ends" : "chips");
      for (const one of row.series) {
        if (row.labels.has(one.name)) continue;
        const chip = make("button", "end");
        chip.type = "button";
        chip.setAttribute("aria-pressed", String(!one.hidden));
        chip.addEventListener("click", () => this.toggle(one.name, !one.hidden));
        const first = !named.has(one.name);
        const constant = one.kind === "line" && one.t.length === 2 && one.v[0] === one.v[1];
        if (constant && !first) continue; // a limit has its name once and no value at the instant
        named.add(one.name);
        const role = one.kind === "band" ? "estimate" : one.role;
        chip.style.color = this.colour(role);
        chip.append(make("b", "", first ? one.name : ""), make("i", ""));
        chip.title = `${one.name}: ${one.hidden ? "show" : "hide"}`;
        chips.append(chip);
        row.labels.set(one.name, { chip, one, value: constant ? null : chip.lastChild });
      }
      box.append(head);
      if (!this.gutter) box.append(chips);
      this.host.append(box);
      const plot = new uPlot(this.options(row, k, last, height), axes.table(row), box);
      if (this.gutter) box.append(chips);
      row.cursor = make("div", "instant");
      plot.over.append(row.cursor);
      this.listen(plot);
      this.plots.push(plot);
      row.plot = plot;
    }

    // A label shows and hides what it names, in all rows.
    toggle(name, hidden) {
      for (const row of this.rows) for (const one of row.series) if (one.name === name) one.hidden = hidden;
      this.draw();
    }

    // Once uPlot has laid a row out: its labels and the instant.
    settle(row) {
      if (!row.plot || !row.cursor) return;
      this.followRow(row, flight.t);
      this.placeEnds(row); // as high as they are with their values
    }

    options(row, k, last, height) {
      const muted = this.colour("muted");
      const grid = { stroke: this.colour("grid"), width: 1 };
      const axis = { stroke: muted, font: FONT(11), grid, ticks: { stroke: this.colour("rule"), width: 1, size: 4 }, gap: 4 };
      const strip = flight.facts.phases.length ? (k ? STRIP_PX : NAMES_PX) : 2;
      const across = { ...axis, show: true, size: last ? BOTTOM_PX : 6, space: 60 };
      if (!last) across.values = (u, splits) => splits.map(() => "");
      else across.values = (u, splits) => splits.map((t, n) => (n === splits.length - 1 && n ? `${+t.toFixed(3)} s` : String(+t.toFixed(3)).replace("-", "\u2212")));
      const upright = { ...axis, size: LEFT_PX, space: 26 };
      if (row.log) upright.splits = (u, k_, low, high) => axes.decades(low, high);
      upright.values = (u, splits) => splits.map((v) => (v === null ? "" : short(+v.toPrecision(6)).replaceAll("-", "\u2212")));
      const series = [{}];
      const bands = [];
      for (const one of row.lines) {
        if (one.hidden) continue;
        if (one.kind === "line") {
          series.push({ stroke: this.colour(one.role), width: WIDTHS[one.role] || 1.4, dash: DASHES[one.role], points: { show: false }, spanGaps: false });
          continue;
        }
        const edge = { stroke: "transparent", width: 0, points: { show: false } };
        bands.push({ series: [series.length, series.length + 1], fill: this.colour("band") });
        series.push(edge, { ...edge });
      }
      if (series.length === 1) series.push({ show: false });
      return {
        width: this.width - this.gutter, height: height - TITLE_PX + (last ? BOTTOM_PX : 6),
        padding: [strip + 2, 16, 0, 0], legend: { show: false },
        cursor: { x: false, y: false, points: { show: false }, drag: { x: true, y: false, setScale: false } },
        scales: {
          x: { time: false, range: () => this.window() },
          y: { distr: row.log ? 3 : 1, dir: row.reversed ? -1 : 1, range: () => axes.reach(row, flight.zoom !== null, this.window()) },
        },
        axes: [across, upright], series, bands,
        hooks: { drawClear: [(u) => this.ground(u, k, strip)], draw: [(u) => this.marks(u, row, k), () => this.settle(row)], setSelect: [(u) => this.selected(u)] },
      };
    }

    // Phases as a strip above the axes, GPS outages behind the lines.
    ground(u, k, strip) {
      const { ctx, bbox } = u;
      const dpr = devicePixelRatio || 1;
      const [from, to] = this.window();
      ctx.save();
      for (const [t0, t1] of flight.facts.outages) {
        const left = Math.max(bbox.left, u.valToPos(t0, "x", true));
        const right = Math.min(bbox.left + bbox.width, u.valToPos(t1, "x", true));
        if (right <= left) continue;
        ctx.fillStyle = this.colour("window");
        ctx.fillRect(left, bbox.top, right - left, bbox.height);
        if (!k) this.word(ctx, "GPS outage", left + 3 * dpr, bbox.top + 12 * dpr, right - left, "alert", dpr);
      }
      for (const phase of flight.facts.phases) {
        if (phase.t1 <= from || phase.t0 >= to) continue;
        const left = u.valToPos(Math.max(from, phase.t0), "x", true);
        const right = u.valToPos(Math.min(to, phase.t1), "x", true);
        ctx.fillStyle = this.colour(`phase-${phase.name}`);
        ctx.fillRect(left, bbox.top - (strip + 1) * dpr, Math.max(1, right - left - dpr), strip * dpr);
        if (!k) this.word(ctx, phase.name, left + 4 * dpr, bbox.top - 5 * dpr, right - left - 6 * dpr, "ink", dpr);
      }
      ctx.restore();
    }

    word(ctx, text, x, y, room, role, dpr, halo = false) {
      ctx.font = FONT(10.5 * dpr);
      ctx.textAlign = "left";
      ctx.textBaseline = "alphabetic";
      if (ctx.measureText(text).width > room) return;
      if (halo) {
        ctx.setLineDash([]);
        ctx.lineWidth = 3 * dpr;
        ctx.lineJoin = "round";
        ctx.strokeStyle = this.colour("surface");
        ctx.strokeText(text, x, y);
      }
      ctx.fillStyle = this.colour(role);
      ctx.fillText(text, x, y);
    }

    // Readings as dots, what was not fused as crosses, moments as upright lines.
    marks(u, row, k) {
      const { ctx, bbox } = u;
      const dpr = devicePixelRatio || 1;
      const [from, to] = this.window();
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      const ends = []; // of the words so far, a line each: those that would lie over others go on the next
      for (const moment of flight.facts.moments) {
        if (moment.t < from || moment.t > to) continue;
        const x = Math.round(u.valToPos(moment.t, "x", true));
        ctx.strokeStyle = this.colour("muted");
        ctx.lineWidth = dpr;
        ctx.setLineDash([2 * dpr, 2 * dpr]);
        ctx.beginPath();
        ctx.moveTo(x, bbox.top);
        ctx.lineTo(x, bbox.top + bbox.height);
        ctx.stroke();
        if (k) continue;
        ctx.font = FONT(10.5 * dpr);
        const wide = ctx.measureText(moment.name).width + 9 * dpr;
        let line = ends.findIndex((end) => end <= x);
        if (line < 0) line = ends.length;
        ends[line] = x + wide;
        this.word(ctx, moment.name, x + 3 * dpr, bbox.top + (11 + 12 * line) * dpr, bbox.left + bbox.width - x, "muted", dpr, true);
      }
      ctx.setLineDash([]);
      for (const one of row.series) {
        if (one.hidden || (one.kind !== "dots" && one.kind !== "crosses")) continue;
        ctx.fillStyle = ctx.strokeStyle = this.colour(one.role);
        ctx.globalAlpha = one.kind === "dots" ? 0.45 : 0.9;
        ctx.lineWidth = 1.1 * dpr;
        const size = (one.kind === "dots" ? 1.5 : 2.3) * dpr;
        ctx.beginPath();
        for (let n = Math.max(0, flight.before(one.t, from)); n < one.t.length && one.t[n] <= to; n++) {
          if (!Number.isFinite(one.v[n]) || (row.log && one.v[n] <= 0)) continue;
          const x = u.valToPos(one.t[n], "x", true);
          const y = u.valToPos(one.v[n], "y", true);
          if (one.kind === "dots") ctx.rect(x - size, y - size, 2 * size, 2 * size);
          else {
            ctx.moveTo(x - size, y - size);
            ctx.lineTo(x + size, y + size);
            ctx.moveTo(x - size, y + size);
            ctx.lineTo(x + size, y - size);
          }
        }
        if (one.kind === "dots") ctx.fill();
        else ctx.stroke();
      }
      ctx.restore();
    }

    selected(u) {
      if (u.select.width < 4) return;
      flight.setZoom([u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x")]);
      u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    }

    listen(plot) {
      plot.over.style.touchAction = "pan-y";
      const point = (event) => {
        if (event.pointerType !== "mouse" || !event.buttons) flight.setInstant(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
      };
      plot.over.addEventListener("pointermove", point);
      plot.over.addEventListener("pointerdown", point);
      plot.over.addEventListener("dblclick", () => flight.setZoom(null));
    }

    // The place of the last value in sight; -1 where there is none.
    end(one) {
      const [from, to] = this.window();
      let k = flight.before(one.t, to);
      while (k > 0 && !Number.isFinite(one.v[k]) && one.t[k] > from) k--;
      return k;
    }

    // Labels beside the ends of their lines, moved apart where they would lie on each other.
    placeEnds(row) {
      if (!this.gutter) return;
      const { plot } = row;
      const top = plot.over.offsetTop;
      const places = [...row.labels.values()].map((label) => {
        const k = this.end(label.one);
        const value = k >= 0 ? label.one.v[k] + (label.one.m ? label.one.m[k] : 0) : NaN;
        const y = Number.isFinite(value) && !(row.log && value <= 0) ? plot.valToPos(value, "y") : 0;
        return { label, y: Math.min(plot.over.clientHeight, Math.max(0, y)), high: label.chip.offsetHeight };
      });
      places.sort((a, b) => a.y - b.y);
      let free = -TITLE_PX;
      for (const place of places) {
        place.at = Math.max(free, place.y - place.high / 2);
        free = place.at + place.high;
      }
      let floor = plot.over.clientHeight + 18;
      for (const place of places.reverse()) {
        place.at = Math.min(place.at, floor - place.high);
        floor = place.at;
        place.label.chip.style.top = `${Math.max(-top, place.at) + top + TITLE_PX}px`;
      }
    }

    fit() {
      for (const row of this.rows) {
        row.plot.setScale("x", { min: this.window()[0], max: this.window()[1] });
        row.plot.redraw(true, true);
      }
    }

    follow(t) {
      for (const row of this.rows) this.followRow(row, t);
    }

    followRow(row, t) {
      const [from, to] = this.window();
      const inside = t >= from && t <= to;
      row.cursor.style.display = inside ? "" : "none";
      if (inside) row.cursor.style.transform = `translateX(${row.plot.valToPos(t, "x").toFixed(2)}px)`;
      // Until somebody moves the instant, on paper and where it is out of sight a label has its curve's last value.
      const still = !flight.moved || !inside || document.documentElement.classList.contains("paper");
      for (const { one, value } of row.labels.values()) {
        if (!value) continue;
        const here = still ? (this.end(one) < 0 ? NaN : one.v[this.end(one)]) : flight.nearest(one.t, one.v, t);
        value.textContent = `${one.kind === "band" && Number.isFinite(here) ? "\u00b1" : ""}${flight.number(here)}`;
      }
    }

    // The panel's data as CSV: a row for every instant, a column for each series, empty where it has no value.
    csv() {
      const all = this.rows.flatMap((row) => row.series.map((one) => ({ name: `${row.title}: ${one.name}`, one })));
      const quoted = (text) => `"${(/^[=+@-]/.test(text) ? `'${text}` : text).replaceAll('"', '""')}"`;
      const tables = all.map(({ one }) => [one.t, Array.from(one.v)]);
      const joined = tables.length === 1 ? tables[0] : uPlot.join(tables);
      const lines = [["t_s", ...all.map(({ name }) => quoted(name))].join(",")];
      const written = (value) => (Number.isFinite(value) ? String(+value.toPrecision(12)) : "");
      for (let k = 0; k < joined[0].length; k++) lines.push(joined.map((column) => written(column[k])).join(","));
      return lines.join("\n") + "\n";
    }
  }

  return { Panel, make, FONT };
})();
