// The record's data: columns unpacked from gzip, and what every part of the page shares: the instant and the zoom.
"use strict";
const flight = (() => {
  const MISSING = -2147483648;

  // Whole numbers of 32 bits, byte planes of folded differences, times the column's step.
  function column(bytes, at, count, step) {
    const values = new Float64Array(count);
    const digits = Math.round(-Math.log10(step));
    const scale = 10 ** Math.abs(digits);
    let sum = 0;
    for (let k = 0; k < count; k++) {
      const folded = bytes[at + k] | (bytes[at + count + k] << 8) | (bytes[at + 2 * count + k] << 16) | (bytes[at + 3 * count + k] << 24);
      sum = (sum + ((folded >>> 1) ^ -(folded & 1))) | 0;
      values[k] = sum === MISSING ? NaN : digits > 0 ? sum / scale : sum * scale;
    }
    return values;
  }

  async function unpack(text, { steps, counts }) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
    let at = 0;
    return steps.map((step, k) => {
      const values = column(bytes, at, counts[k], step);
      at += 4 * counts[k];
      return values;
    });
  }

  // The place of the last time that is not after t; -1 before the first.
  function before(times, t) {
    let low = -1;
    let high = times.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle;
      else high = middle;
    }
    return low;
  }

  // The value nearest in time, NaN farther than a second and three of its own intervals away.
  function nearest(times, values, t) {
    const k = before(times, t);
    const pick = k < 0 ? 0 : k + 1 < times.length && times[k + 1] - t < t - times[k] ? k + 1 : k;
    const reach = Math.max(1, (3 * (times[times.length - 1] - times[0])) / Math.max(1, times.length - 1));
    return times.length && Math.abs(times[pick] - t) <= reach ? values[pick] : NaN;
  }

  // A value on the straight line between two neighbours; the end's value beyond an end.
  function between(times, values, t) {
    const k = before(times, t);
    if (k < 0) return values[0];
    if (k + 1 >= times.length) return values[values.length - 1];
    const share = (t - times[k]) / (times[k + 1] - times[k] || 1);
    return values[k] + share * (values[k + 1] - values[k]);
  }

  const number = (value, digits = 3) => {
    if (!Number.isFinite(value)) return "\u2013";
    const size = Math.abs(value);
    const places = size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : size >= 0.01 || size === 0 ? digits : digits + 2;
    return value.toFixed(places).replace("-", "\u2212");
  };

  const styles = getComputedStyle(document.documentElement);
  const colour = (role) => styles.getPropertyValue(`--${role}`).trim();

  // The state that the whole page shares. `moved`: somebody chose the instant. `follow` is called with it, `fit` when the zoom changes.
  const shared = { t: 0, moved: false, zoom: null, followers: [], fitters: [], pending: false };
  function setInstant(t) {
    const { t0, t1 } = shared.facts;
    shared.t = Math.min(t1, Math.max(t0, t));
    shared.moved = true;
    if (shared.pending) return;
    shared.pending = true;
    requestAnimationFrame(() => {
      shared.pending = false;
      for (const follow of shared.followers) follow(shared.t);
      document.documentElement.dataset.instant = shared.t.toFixed(3);
    });
  }
  function setZoom(zoom) {
    shared.zoom = zoom && zoom[1] - zoom[0] > 1e-3 ? zoom : null;
    for (const fit of shared.fitters) fit(shared.zoom);
    document.documentElement.dataset.zoom = shared.zoom ? shared.zoom.map((end) => end.toFixed(3)).join(" ") : "";
  }
  const phaseAt = (t) => shared.facts.phases.find((phase) => t >= phase.t0 && t <= phase.t1);

  return Object.assign(shared, { unpack, before, nearest, between, number, colour, setInstant, setZoom, phaseAt });
})();
