// A canvas with the paths of a flight, coloured by time, and the vehicle at the page's instant; how it is looked at is its heirs'.
"use strict";
const canvas = (() => {
  // From the first instant to the last: colours that differ in lightness and in hue, on light and on dark.
  const TIME = {
    light: ["#3d4a9e", "#2b7bba", "#1c9a8f", "#5a9a2f", "#c28a10", "#cf4a1f"],
    dark: ["#8f9bf0", "#5fb3ee", "#4fd0c0", "#9ad06a", "#f0c455", "#ff8a5c"],
  };
  const CHUNKS = 90;
  const ROOM_PX = 26;
  const dark = matchMedia("(prefers-color-scheme: dark)");

  function ramp(share) {
    const onPaper = document.documentElement.classList.contains("paper");
    const stops = TIME[dark.matches && !onPaper ? "dark" : "light"];
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
        this.line(this.points(track, first, last), ramp(share), width);
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
        ctx.fillStyle = ramp(k / long);
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

  return { View, round, metres, ROOM_PX };
})();
