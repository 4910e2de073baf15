// The path in space and the ground track, each on a canvas, with the vehicle at the page's instant.
"use strict";
const paths = (() => {
  // From the first instant to the last: colours that differ in lightness and in hue, on light and on dark.
  const TIME = {
    light: ["#3d4a9e", "#2b7bba", "#1c9a8f", "#5a9a2f", "#c28a10", "#cf4a1f"],
    dark: ["#8f9bf0", "#5fb3ee", "#4fd0c0", "#9ad06a", "#f0c455", "#ff8a5c"],
  };
  const CHUNKS = 90;
  const ROOM_PX = 26;
  const dark = matchMedia("(prefers-color-scheme: dark)");

  function ramp(share, forPaper) {
    const stops = TIME[dark.matches && !forPaper ? "dark" : "light"];
    const place = Math.min(0.9999, Math.max(0, share)) * (stops.length - 1);
    const k = Math.floor(place);
    const part = (text, n) => parseInt(text.slice(1 + 2 * n, 3 + 2 * n), 16);
    const mix = [0, 1, 2].map((n) => Math.round(part(stops[k], n) + (place - k) * (part(stops[k + 1], n) - part(stops[k], n))));
    return `rgb(${mix.join(",")})`;
  }

  // A round length near a wanted one: 1, 2 or 5 times a power of ten.
  function round(length) {
    const power = 10 ** Math.floor(Math.log10(length));
    return power * ([5, 2, 1].find((step) => step * power <= length) || 1);
  }
  const metres = (length) => (length >= 1000 ? `${length / 1000} km` : length >= 1 || length === 0 ? `${+length.toPrecision(3)} m` : `${+(100 * length).toPrecision(3)} cm`);

  class View {
    constructor(host, data) {
      this.host = host;
      this.data = data;
      this.main = data.tracks[data.tracks.length - 1];
      this.canvas = document.createElement("canvas");
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", host.getAttribute("aria-label"));
      this.canvas.style.touchAction = "pan-y";
      host.replaceChildren(this.canvas);
      const low = [Infinity, Infinity, Infinity];
      const high = [-Infinity, -Infinity, -Infinity];
      const take = (point) => point.forEach((value, k) => {
        if (!Number.isFinite(value) || Math.abs(value) > 1e9) return;
        low[k] = Math.min(low[k], value);
        high[k] = Math.max(high[k], value);
      });
      for (const track of data.tracks) for (let k = 0; k < track.t.length; k++) take([track.e[k], track.n[k], -track.d[k]]);
      const half = (data.pad_m || 0) / 2;
      if (half) [[-half, -half, 0], [half, half, 0]].forEach(take);
      if (!(low[0] <= high[0])) [[-1, -1, 0], [1, 1, 1]].forEach(take);
      this.low = low;
      this.high = high;
      this.floor = half ? 0 : low[2];
    }

    size(width, height) {
      const dpr = devicePixelRatio || 1;
      this.width = width || this.host.clientWidth;
      this.height = height || this.host.clientHeight;
      this.canvas.width = Math.round(this.width * dpr);
      this.canvas.height = Math.round(this.height * dpr);
      this.canvas.style.width = `${this.width}px`;
      this.canvas.style.height = `${this.height}px`;
      this.ctx = this.canvas.getContext("2d");
      this.ctx.setTransform(dpr, 0, 0, dpr, 0, 0);
    }

    place(track, t) {
      return [flight.between(track.t, track.e, t), flight.between(track.t, track.n, t), -flight.between(track.t, track.d, t)];
    }

    line(points, colour, width, dash = []) {
      const { ctx } = this;
      ctx.strokeStyle = colour;
      ctx.lineWidth = width;
      ctx.setLineDash(dash);
      ctx.lineJoin = "round";
      ctx.beginPath();
      let open = true;
      for (const point of points) {
        if (!point) { open = true; continue; }
        const [x, y] = this.project(point);
        if (open) ctx.moveTo(x, y);
        else ctx.lineTo(x, y);
        open = false;
      }
      ctx.stroke();
      ctx.setLineDash([]);
    }

    points(track, first = 0, last = track.t.length - 1) {
      const jumps = new Set(track.jumps);
      const found = [];
      for (let k = first; k <= last; k++) {
        if (jumps.has(k)) found.push(null);
        found.push(Number.isFinite(track.e[k] + track.n[k] + track.d[k]) ? [track.e[k], track.n[k], -track.d[k]] : null);
      }
      return found;
    }

    coloured(track, width) {
      const { t0, t1 } = flight.facts;
      const size = Math.max(1, Math.ceil((track.t.length - 1) / CHUNKS));
      for (let first = 0; first < track.t.length - 1; first += size) {
        const last = Math.min(track.t.length - 1, first + size);
        const share = (0.5 * (track.t[first] + track.t[last]) - t0) / (t1 - t0 || 1);
        this.line(this.points(track, first, last), ramp(share, this.paper), width);
      }
    }

    text(words, x, y, role = "muted", align = "left", size = 11) {
      const { ctx } = this;
      ctx.font = panels.FONT(size);
      ctx.textAlign = align;
      ctx.lineWidth = 3;
      ctx.strokeStyle = flight.colour("surface");
      ctx.strokeText(words, x, y);
      ctx.fillStyle = flight.colour(role);
      ctx.fillText(words, x, y);
      ctx.textAlign = "left";
    }

    dot(point, colour, radius) {
      const { ctx } = this;
      const [x, y] = this.project(point);
      ctx.beginPath();
      ctx.arc(x, y, radius, 0, 2 * Math.PI);
      ctx.fillStyle = colour;
      ctx.fill();
      ctx.lineWidth = 1.5;
      ctx.strokeStyle = flight.colour("surface");
      ctx.stroke();
      return [x, y];
    }

    pad() {
      const half = (this.data.pad_m || 0) / 2;
      if (!half) return;
      const corners = [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]];
      const { ctx } = this;
      ctx.beginPath();
      corners.forEach((corner, k) => (k ? ctx.lineTo(...this.project(corner)) : ctx.moveTo(...this.project(corner))));
      ctx.closePath();
      ctx.fillStyle = flight.colour("padfill");
      ctx.fill();
      this.line([...corners, corners[0]], flight.colour("pad"), 1.5);
    }

    others() {
      for (const track of this.data.tracks) if (track !== this.main) this.line(this.points(track), flight.colour(track.role), 1.2);
      this.coloured(this.main, 2.6);
      const estimate = this.data.tracks.find((track) => track.role === "estimate");
      for (const [t0, t1] of estimate ? this.data.outages : []) {
        const first = flight.before(estimate.t, t0) + 1;
        this.line(this.points(estimate, first, flight.before(estimate.t, t1)), flight.colour("alert"), 2.2);
      }
      const { touch } = this.data;
      if (!touch) return;
      const [x, y] = this.project([touch[1], touch[0], -touch[2]]);
      const { ctx } = this;
      ctx.strokeStyle = flight.colour("alert");
      ctx.lineWidth = 2.5;
      ctx.beginPath();
      for (const [dx, dy] of [[5, 5], [5, -5]]) {
        ctx.moveTo(x - dx, y - dy);
        ctx.lineTo(x + dx, y + dy);
      }
      ctx.stroke();
    }

    // Names once, in their colours; the bar of time with the instant on it.
    key() {
      const { ctx } = this;
      let x = 10;
      for (const track of this.data.tracks) {
        const words = track === this.main ? `${track.name}, by time` : track.name;
        this.text(words, x, 16, track === this.main ? "ink" : track.role, "left", 12);
        x += ctx.measureText(words).width + 14;
      }
      if (this.showsGps) this.text("GPS", x, 16, "gps", "left", 12);
      const { t0, t1 } = flight.facts;
      const [left, top, long] = [10, this.height - 14, Math.min(150, 0.3 * this.width)];
      for (let k = 0; k < long; k += 2) {
        ctx.fillStyle = ramp(k / long, this.paper);
        ctx.fillRect(left + k, top, 2, 6);
      }
      ctx.fillStyle = flight.colour("ink");
      ctx.fillRect(left + (long * (flight.t - t0)) / (t1 - t0 || 1) - 1, top - 3, 2, 12);
      this.text(`${+t0.toFixed(0)} s`, left, top - 5);
      this.text(`${+t1.toFixed(0)} s`, left + long, top - 5, "muted", "right");
    }

    mark(point) {
      const [x, y] = this.dot(point, flight.colour("ink"), 6);
      this.canvas.dataset.mark = `${x.toFixed(1)} ${y.toFixed(1)}`;
    }

    draw(width, height) {
      this.paper = Boolean(width);
      this.size(width, height);
      this.scale();
      this.paint();
      this.host.dataset.drawn = "figure";
    }

    paint() {
      this.ctx.clearRect(0, 0, this.width, this.height);
      this.scene();
      this.key();
    }

    follow() {
      if (this.ctx) this.paint();
    }
  }

  class Space extends View {
    constructor(host, data) {
      super(host, data);
      this.turn = -0.6;
      this.tilt = 0.42;
      const across = Math.max(this.high[0] - this.low[0], this.high[1] - this.low[1], 1e-3);
      const up = Math.max(this.high[2] - this.floor, 1e-3);
      this.lift = up > across / 6 && up < 6 * across ? 1 : (0.6 * across) / up;
      this.middle = [0, 1, 2].map((k) => 0.5 * (this.low[k] + this.high[k]));
      this.canvas.addEventListener("pointerdown", (event) => {
        this.held = [event.clientX, event.clientY];
        this.canvas.setPointerCapture(event.pointerId);
      });
      this.canvas.addEventListener("pointermove", (event) => {
        if (!this.held) return;
        this.orbit(0.01 * (event.clientX - this.held[0]), 0.01 * (event.clientY - this.held[1]));
        this.held = [event.clientX, event.clientY];
      });
      for (const end of ["pointerup", "pointercancel"]) this.canvas.addEventListener(end, () => { this.held = null; });
      this.canvas.addEventListener("keydown", (event) => {
        const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
        if (!turn) return;
        event.preventDefault();
        this.orbit(...turn);
      });
    }

    orbit(turn, tilt) {
      this.turn += turn;
      this.tilt = Math.min(Math.PI / 2, Math.max(0, this.tilt + tilt));
      this.paint();
    }

    scale() {
      const [e, n, h] = [0, 1, 2].map((k) => this.high[k] - this.low[k]);
      const across = Math.hypot(e, n) + 1e-3;
      const upright = 0.45 * across + 0.92 * this.lift * Math.max(h, this.high[2] - this.floor, 1e-3);
      this.zoom = Math.min((this.width - 2 * ROOM_PX) / across, (this.height - 3.2 * ROOM_PX) / upright);
    }

    project([e, n, h]) {
      const x = e - this.middle[0];
      const y = n - this.middle[1];
      const along = x * Math.cos(this.turn) - y * Math.sin(this.turn);
      const away = x * Math.sin(this.turn) + y * Math.cos(this.turn);
      const up = (h - this.middle[2]) * this.lift;
      return [this.width / 2 + this.zoom * along, this.height / 2 - this.zoom * (up * Math.cos(this.tilt) + away * Math.sin(this.tilt))];
    }

    scene() {
      const across = Math.max(this.high[0] - this.low[0], this.high[1] - this.low[1], 0.5);
      const step = round(across / 4);
      const edges = [0, 1].map((k) => [Math.floor(this.low[k] / step) * step, Math.ceil(this.high[k] / step) * step]);
      const rule = flight.colour("rule");
      for (let e = edges[0][0]; e <= edges[0][1] + 1e-9; e += step) this.line([[e, edges[1][0], this.floor], [e, edges[1][1], this.floor]], rule, 1);
      for (let n = edges[1][0]; n <= edges[1][1] + 1e-9; n += step) this.line([[edges[0][0], n, this.floor], [edges[0][1], n, this.floor]], rule, 1);
      const corner = [edges[0][0], edges[1][0]];
      const rise = round(Math.max(this.high[2] - this.floor, 0.1) / 3);
      this.line([[...corner, this.floor], [...corner, this.high[2]]], rule, 1);
      for (let h = rise; h <= this.high[2] - this.floor + 1e-9; h += rise) {
        const [x, y] = this.project([...corner, this.floor + h]);
        this.text(metres(h), x - 4, y + 4, "muted", "right", 10);
      }
      const north = this.project([edges[0][1], edges[1][1], this.floor]);
      const south = this.project([edges[0][1], edges[1][1] - step, this.floor]);
      this.arrow(south, north, "N");
      const note = this.lift === 1 ? "" : `, heights \u00d7${+this.lift.toPrecision(2)}`;
      this.text(`grid ${metres(step)}${note}`, this.width - 10, this.height - 8, "muted", "right");
      this.pad();
      const ground = this.points(this.main).map((point) => point && [point[0], point[1], this.floor]);
      this.line(ground, flight.colour("shade"), 1.5);
      this.others();
      const here = this.place(this.main, flight.t);
      this.line([here, [here[0], here[1], this.floor]], flight.colour("muted"), 1, [3, 3]);
      this.mark(here);
    }

    arrow([x0, y0], [x1, y1], words) {
      const { ctx } = this;
      const turn = Math.atan2(y1 - y0, x1 - x0);
      ctx.strokeStyle = ctx.fillStyle = flight.colour("muted");
      ctx.lineWidth = 1.5;
      ctx.beginPath();
      ctx.moveTo(x0, y0);
      ctx.lineTo(x1, y1);
      for (const side of [2.6, -2.6]) {
        ctx.moveTo(x1, y1);
        ctx.lineTo(x1 + 8 * Math.cos(turn + side), y1 + 8 * Math.sin(turn + side));
      }
      ctx.stroke();
      this.text(words, x1 + 9 * Math.cos(turn), y1 + 9 * Math.sin(turn) + 4, "muted", "center", 12);
    }
  }

  class Track extends View {
    constructor(host, data, buttons) {
      super(host, data);
      this.showsGps = Boolean(data.gps);
      this.look = null;
      this.canvas.addEventListener("pointermove", (event) => this.point(event));
      this.canvas.addEventListener("pointerdown", (event) => this.point(event));
      const offer = (words, look) => {
        const button = panels.make("button", "small", words);
        button.type = "button";
        button.addEventListener("click", () => {
          this.look = look();
          this.scale();
          this.paint();
        });
        buttons.append(button);
      };
      const middle = () => this.look || { e: 0.5 * (this.low[0] + this.high[0]), n: 0.5 * (this.low[1] + this.high[1]), span: this.span() };
      offer("Whole path", () => null);
      if (data.pad_m) offer("Pad", () => ({ e: 0, n: 0, span: 1.4 * data.pad_m }));
      offer("Vehicle", () => {
        const [e, n] = this.place(this.main, flight.t);
        return { ...middle(), e, n, span: Math.min(middle().span, Math.max(2, this.span() / 8)) };
      });
      offer("\u2212", () => ({ ...middle(), span: middle().span * 1.6 }));
      offer("+", () => ({ ...middle(), span: middle().span / 1.6 }));
    }

    span() {
      return 1.08 * Math.max(this.high[1] - this.low[1], ((this.high[0] - this.low[0]) * (this.height - 2 * ROOM_PX)) / (this.width - 2 * ROOM_PX), 0.5);
    }

    scale() {
      const { e, n, span } = this.look || { e: 0.5 * (this.low[0] + this.high[0]), n: 0.5 * (this.low[1] + this.high[1]), span: this.span() };
      this.centre = [e, n];
      this.zoom = (this.height - 2 * ROOM_PX) / span;
    }

    project([e, n]) {
      return [this.width / 2 + this.zoom * (e - this.centre[0]), this.height / 2 - this.zoom * (n - this.centre[1])];
    }

    scene() {
      this.pad();
      const { ctx, data } = this;
      if (data.gps) {
        ctx.fillStyle = flight.colour("gps");
        ctx.globalAlpha = 0.35;
        for (let k = 0; k < data.gps.e.length; k++) {
          const [x, y] = this.project([data.gps.e[k], data.gps.n[k]]);
          ctx.fillRect(x - 1.5, y - 1.5, 3, 3);
        }
        ctx.globalAlpha = 1;
      }
      this.others();
      const long = round((0.25 * this.width) / this.zoom);
      const [left, y] = [this.width - 14 - long * this.zoom, this.height - 10];
      ctx.fillStyle = flight.colour("ink");
      ctx.fillRect(left, y, long * this.zoom, 2);
      ctx.fillRect(left, y - 4, 1.5, 6);
      ctx.fillRect(left + long * this.zoom - 1.5, y - 4, 1.5, 6);
      this.text(metres(long), left + 0.5 * long * this.zoom, y - 6, "ink", "center");
      Space.prototype.arrow.call(this, [this.width - 22, 66], [this.width - 22, 40], "N");
      this.mark(this.place(this.main, flight.t));
    }

    // The instant at which the path came nearest to the pointer, where that is near enough.
    point(event) {
      const box = this.canvas.getBoundingClientRect();
      const [px, py] = [event.clientX - box.left, event.clientY - box.top];
      let best = 22 * 22;
      let found = NaN;
      for (let k = 0; k < this.main.t.length; k++) {
        const [x, y] = this.project([this.main.e[k], this.main.n[k]]);
        const far = (x - px) ** 2 + (y - py) ** 2 + 1e-9 * Math.abs(this.main.t[k] - flight.t);
        if (far < best) {
          best = far;
          found = this.main.t[k];
        }
      }
      if (Number.isFinite(found)) flight.setInstant(found);
    }
  }

  return { Space, Track };
})();
