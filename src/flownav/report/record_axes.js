// The content of a row of a panel: its lines on one time base for uPlot, how far its axis reaches, where a logarithmic one is marked.
"use strict";
const axes = (() => {
  function pausesOf(times) {
    const steps = [...times].slice(1).map((t, k) => t - times[k]).sort((a, b) => a - b);
    return Math.max(0.5, 20 * (steps[steps.length >> 1] || 0));
  }

  // uPlot's data of a row: every line and band on one time base; a hole where a value is missing or a band pauses.
  function table(row) {
    const tables = [];
    for (const one of row.lines) {
      if (one.hidden) continue;
      const holes = (sign) => Array.from(one.v, (value, k) => (Number.isFinite(value) && !(row.log && value <= 0) ? sign * value + (one.m ? one.m[k] : 0) : null));
      if (one.kind === "line") tables.push([one.t, holes(1)]);
      else {
        const limit = pausesOf(one.t);
        const open = (values) => values.map((value, k) => (k + 1 < one.t.length && one.t[k + 1] - one.t[k] > limit ? null : value));
        tables.push([one.t, open(holes(1)), open(holes(-1))]);
      }
    }
    if (!tables.length) return [[flight.facts.t0, flight.facts.t1], [null, null]];
    return tables.length === 1 ? tables[0] : uPlot.join(tables);
  }

  // Powers of ten on a logarithmic axis, at most five of them.
  function decades(low, high) {
    const [first, last] = [Math.ceil(Math.log10(low) - 1e-9), Math.floor(Math.log10(high) + 1e-9)];
    const step = Math.max(1, Math.ceil((last - first) / 4));
    return Array.from({ length: Math.floor((last - first) / step) + 1 }, (_, k) => 10 ** (first + k * step));
  }

  // Whether a band counts for its axis at an instant. On the ground it may run beyond: a vehicle at rest that nobody
  // navigates states much, which would flatten the flight.
  function counts(zoomed, [from, to]) {
    const resting = (one) => one.name === "ground" || one.name === "landed";
    const inSight = flight.facts.phases.filter((one) => one.t1 > from && one.t0 < to);
    if (zoomed || inSight.every(resting)) return () => true;
    const rests = inSight.filter(resting);
    return (t) => !rests.some((one) => t >= one.t0 && t <= one.t1);
  }

  // How far a band widens its axis: all of it, or 90 % of the time where the rest is ten times as wide.
  function widest(one, zoomed, [from, to]) {
    if (one.kind !== "band") return Infinity;
    const counted = counts(zoomed, [from, to]);
    const wide = Array.from(one.v).filter((v, k) => Number.isFinite(v) && one.t[k] >= from && one.t[k] <= to && counted(one.t[k])).sort((a, b) => a - b);
    const most = wide[Math.floor(0.9 * (wide.length - 1))] || 0;
    return !zoomed && wide[wide.length - 1] > 10 * most ? most : wide[wide.length - 1] || 0;
  }

  function reach(row, zoomed, [from, to]) {
    let low = Infinity;
    let high = -Infinity;
    for (const one of row.series) {
      if (one.hidden) continue;
      const most = widest(one, zoomed, [from, to]);
      const first = Math.max(0, flight.before(one.t, from));
      for (let k = first; k < one.t.length && one.t[k] <= to; k++) {
        const value = Math.min(one.v[k], most);
        if (!Number.isFinite(value) || (row.log && value <= 0)) continue;
        const middle = one.m ? one.m[k] : 0;
        const least = one.kind === "band" ? middle - value : value;
        if (least < low) low = least;
        if (middle + value > high) high = middle + value;
      }
    }
    if (row.within !== undefined && !zoomed) return [-row.within, row.within];
    if (low > high) return row.log ? [0.1, 10] : [-1, 1];
    if (row.log) return [10 ** Math.floor(Math.log10(low)), 10 ** Math.ceil(Math.log10(high) + 1e-9)];
    if (row.from_zero) return [0, Math.max(high, 1e-6) * 1.06];
    if (high - low < 1e-6) return [low - 1, high + 1];
    return [low - 0.06 * (high - low), high + 0.06 * (high - low)];
  }

  return { table, decades, reach };
})();
