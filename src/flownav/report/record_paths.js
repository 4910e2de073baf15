// The path in space and the ground track, each on a canvas, with the vehicle at the page's instant.
"use strict";
const paths = (() => {
  const { View, round, metres, ROOM_PX } = canvas;
  const LABEL_PX = 44; // beside the grid, for the heights at its corner and the arrow to north, however it is turned

  class Space extends View {
    constructor(host, data) {
      super(host, data);
      this.turn = -0.6;
      this.tilt = 0.42;
      const across = Math.max(this.high[0] - this.low[0], this.high[1] - this.low[1], 1e-3);
      const up = Math.max(this.high[2] - this.floor, 1e-3);
      this.step = round(Math.max(across, 0.5) / 4);
      this.edges = [0, 1].map((k) => [Math.floor(this.low[k] / this.step) * this.step, Math.ceil(this.high[k] / this.step) * this.step]);
      this.lift = up > across / 6 && up < 6 * across ? 1 : (0.6 * across) / up;
      this.middle = [...this.edges.map(([low, high]) => 0.5 * (low + high)), 0.5 * (this.low[2] + this.high[2])];
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
      const [e, n] = this.edges.map(([low, high]) => high - low);
      const h = this.high[2] - this.low[2];
      const across = Math.hypot(e, n) + 1e-3;
      const upright = 0.45 * across + 0.92 * this.lift * Math.max(h, this.high[2] - this.floor, 1e-3);
      this.zoom = Math.min((this.width - 2 * LABEL_PX) / across, (this.height - 3.2 * ROOM_PX) / upright);
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
      const { step, edges } = this;
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
      if (flight.facts.north) this.arrow(south, north, "N");
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
      if (flight.facts.north) Space.prototype.arrow.call(this, [this.width - 22, 66], [this.width - 22, 40], "N");
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
