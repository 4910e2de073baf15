// What `flownav replay RECORD --json` says of a flight, by the same arithmetic as NumPy's, so that its digits are the same.

// NumPy's pairwise sum of contiguous numbers.
export function sum(a, from = 0, count = a.length) {
  if (count < 8) { let total = 0; for (let i = 0; i < count; i++) total += a[from + i]; return total; }
  if (count <= 128) {
    const r = Array.from(a.slice(from, from + 8));
    let i = 8;
    for (; i < count - (count % 8); i += 8) for (let k = 0; k < 8; k++) r[k] += a[from + i + k];
    let total = r[0] + r[1] + (r[2] + r[3]) + (r[4] + r[5] + (r[6] + r[7]));
    for (; i < count; i++) total += a[from + i];
    return total;
  }
  const half = (count >> 1) - ((count >> 1) % 8);
  return sum(a, from, half) + sum(a, from + half, count - half);
}
export const mean = (a) => sum(a) / a.length;
export const rms = (a) => Math.sqrt(mean(a.map((x) => x * x)));
const along = (rows, k) => rows.reduce((total, row) => total + row[k], 0) / rows.length; // mean(axis=0)
const most = (a) => a.reduce((found, x) => Math.max(found, x), -Infinity);

// The last place whose time is not later; -1 before the first.
export function placeOf(times, t) {
  let low = 0, high = times.length;
  while (low < high) { const mid = (low + high) >> 1; if (times[mid] <= t) low = mid + 1; else high = mid; }
  return low - 1;
}

export function interp(t, times, values) {
  const n = times.length, j = placeOf(times, t);
  if (j < 0) return values[0];
  if (j >= n - 1 || times[j] === t) return values[Math.min(j, n - 1)];
  const slope = (values[j + 1] - values[j]) / (times[j + 1] - times[j]);
  return slope * (t - times[j]) + values[j];
}

export function median(a) {
  const sorted = Float64Array.from(a).sort(), half = sorted.length >> 1;
  return sorted.length % 2 ? sorted[half] : (sorted[half - 1] + sorted[half]) / 2;
}

export function percentile(a, q) {
  const sorted = Float64Array.from(a).sort(), at = (sorted.length - 1) * (q / 100), low = Math.floor(at), t = at - low;
  const one = sorted[low], two = sorted[Math.min(low + 1, sorted.length - 1)], step = two - one;
  return t >= 0.5 ? two - step * (1 - t) : one + step * t;
}

// Estimate less reference at the reference's instants that the estimate covers; both as {t, columns}.
export function differenceAt(estimate, reference) {
  const rows = [], n = estimate.t.length;
  for (let i = 0; i < reference.t.length; i++) {
    const t = reference.t[i];
    if (n && t >= estimate.t[0] && t <= estimate.t[n - 1]) {
      rows.push(reference.columns.map((column, k) => interp(t, estimate.t, estimate.columns[k]) - column[i]));
    }
  }
  return rows;
}
const squared = (rows) => rows.map((row) => row[0] * row[0] + row[1] * row[1]);
export const horizontalRms = (estimate, reference) => {
  const rows = differenceAt(estimate, reference);
  return rows.length ? Math.sqrt(mean(squared(rows))) : null;
};

// An outage of GPS: horizontal error against the truth, turned onto GPS's north (or, where GPS does not show it, onto the
// path), at the instants that GPS describes, or against its fixes where there is no truth; less the mean of the first five.
export function outage(path, gps, truth, delayS, [t0, t1]) {
  const byGps = truth && truthPlaced({ t: gps.t.map((t) => t - delayS), columns: gps.columns }, truth);
  const placed = byGps && byGps.shown ? byGps : truth && truthPlaced(path, truth);
  const fixes = !placed ? gps : {
    t: Float64Array.from(truth.t_s, (t) => t + delayS),
    columns: ((rows) => [0, 1].map((k) => rows.map((row) => row[k])))(rowsOf(truth).map(placed.turned)),
  };
  const inside = [...fixes.t.keys()].filter((i) => fixes.t[i] >= t0 && fixes.t[i] < t1);
  const reference = { t: inside.map((i) => fixes.t[i] - delayS), columns: fixes.columns.slice(0, 2).map((c) => inside.map((i) => c[i])) };
  const rows = differenceAt(path, reference);
  if (rows.length <= 5) return { t0, t1, horizontal_rms_m: null, horizontal_max_m: null };
  const first = rows.slice(0, 5), anchor = [along(first, 0), along(first, 1)];
  const squares = squared(rows.map((row) => [row[0] - anchor[0], row[1] - anchor[1]]));
  return { t0, t1, horizontal_rms_m: Math.sqrt(mean(squares)), horizontal_max_m: Math.sqrt(most(squares)) };
}

const LEAST_SPREAD_M = 0.2, LEAST_LIKENESS = 0.5;

// The truth turned and shifted onto the estimate (least squares in the horizontal plane).
export function align(ours, theirs) {
  const a = [0, 1, 2].map((k) => along(ours, k)), b = [0, 1, 2].map((k) => along(theirs, k)), re = [], im = [];
  ours.forEach((row, i) => {
    const c = row[0] - a[0], d = row[1] - a[1], p = theirs[i][0] - b[0], q = theirs[i][1] - b[1];
    re.push(p * c + q * d); im.push(p * d - q * c);
  });
  const x = sum(re), y = sum(im), length = Math.sqrt(x * x + y * y);
  const cosine = length > 0 ? x / length : 1, sine = length > 0 ? y / length : 0;
  const turned = ([n, e, z]) => [cosine * n - sine * e, sine * n + cosine * e, z];
  const shift = turned(b).map((value, k) => a[k] - value);
  const spread = (rows, middle) => Math.sqrt(mean(rows.map((row) => (row[0] - middle[0]) ** 2 + (row[1] - middle[1]) ** 2)));
  const wide = [spread(ours, a), spread(theirs, b)], likeness = length / Math.max(ours.length * wide[0] * wide[1], 1e-12);
  const shown = Math.min(...wide) >= LEAST_SPREAD_M && likeness >= LEAST_LIKENESS; // as scoring/reference.py
  return { turned, shown, moved: (row) => turned(row).map((value, k) => value + shift[k]) };
}

const SPAN_S = 0.1;
function velocityOf(t, rows) {
  const last = t.length - 1, columns = [0, 1, 2].map((k) => Float64Array.from(rows, (row) => row[k]));
  return Array.from(t, (at) => {
    const late = Math.min(at + 0.5 * SPAN_S, t[last]), early = Math.max(at - 0.5 * SPAN_S, t[0]);
    return columns.map((column) => (interp(late, t, column) - interp(early, t, column)) / (late - early));
  });
}

const rowsOf = (truth) => Array.from(truth.t_s, (_, i) => [truth.pos_n_m[i], truth.pos_e_m[i], truth.pos_d_m[i]]);

// How a truth lies in the path's frame; null without two rows of it that the path covers.
function truthPlaced(path, truth) {
  const n = path.t.length, covered = rowsOf(truth).filter((_, i) => truth.t_s[i] >= path.t[0] && truth.t_s[i] <= path.t[n - 1]);
  if (covered.length < 2) return null;
  const apart = differenceAt(path, { t: truth.t_s, columns: [truth.pos_n_m, truth.pos_e_m, truth.pos_d_m] });
  return align(covered.map((row, i) => row.map((v, k) => v + apart[i][k])), covered);
}

export function truthScores(path, velocity, truth) {
  const rows = rowsOf(truth), placed = truthPlaced(path, truth);
  if (!placed) return null;
  const moved = rows.map(placed.moved);
  const error = differenceAt(path, { t: truth.t_s, columns: [0, 1, 2].map((k) => moved.map((row) => row[k])) });
  const squares = squared(error), moving = velocityOf(truth.t_s, rows).map(placed.turned);
  return {
    horizontal_rms_m: Math.sqrt(mean(squares)), horizontal_max_m: Math.sqrt(most(squares)),
    vertical_rms_m: rms(error.map((row) => row[2])),
    velocity_rms_m_s: horizontalRms(velocity, { t: truth.t_s, columns: [0, 1].map((k) => moving.map((row) => row[k])) }),
    error, moved,
  };
}

export function protection(estimates) {
  const told = estimates.filter((row) => Number.isFinite(row.protection_m[0]) && Number.isFinite(row.protection_m[1]));
  const summary = (k) => { const levels = told.map((row) => row.protection_m[k]); return { median: median(levels), p95: percentile(levels, 95) }; };
  return told.length ? { horizontal_m: summary(0), vertical_m: summary(1) } : null;
}

// Whether an instant is in flight by a signal that is 1 on the ground; always where it knows of no flight.
function aloft(landed) {
  const [value] = landed.columns, flies = value.some((v) => v < 0.5);
  return (t) => {
    if (!flies) return true;
    let row = 0;
    while (row + 1 < landed.t.length && landed.t[row + 1] <= t) row += 1;
    return value[row] < 0.5;
  };
}

// By sensor: components that were not fused, by reason; and innovations squared over what was expected of them, of those that
// were fused in flight. landed: what says when it flies.
export function innovationScores(innovations, landed, SENSOR, REASON) {
  const flies = aloft(landed);
  const names = Object.fromEntries(Object.entries(SENSOR).map(([name, value]) => [value, name.toLowerCase()]));
  const labels = Object.fromEntries(Object.entries(REASON).map(([name, value]) => [value, name.toLowerCase()]));
  const beside = new Set(innovations.filter((row) => Number.isFinite(row.observation)).map((row) => `${row.sensor} ${row.t_s}`));
  const mayLeaveOut = new Set([SENSOR.GPS_VELOCITY, SENSOR.FLOW_VELOCITY, SENSOR.PAD]);
  const rejected = {}, tested = {};
  for (const row of innovations) {
    const name = names[row.sensor], leftOut = mayLeaveOut.has(row.sensor) && row.component === 2 && Number.isNaN(row.observation);
    if ((row.reason === REASON.FUSED || row.reason === REASON.INNOVATION_GATE) && flies(row.t_s)) (tested[name] ??= []).push(row);
    if (row.reason === REASON.FUSED || row.reason === REASON.DATUM) continue;
    if (leftOut && row.reason === REASON.NOT_FINITE && beside.has(`${row.sensor} ${row.t_s}`)) continue;
    const counts = (rejected[name] ??= {});
    counts[labels[row.reason]] = (counts[labels[row.reason]] ?? 0) + 1;
  }
  const believed = (rows) => { const fused = rows.filter((row) => row.reason === REASON.FUSED); return fused.length ? fused : rows; };
  const consistency = Object.fromEntries(Object.entries(tested).map(([name, every]) => [name, believed(every)]).map(([name, rows]) => [name, {
    nis_per_dof: mean(rows.map((row) => (row.innovation * row.innovation) / row.innovation_variance)), samples: rows.length,
  }]));
  return { rejected, consistency };
}
