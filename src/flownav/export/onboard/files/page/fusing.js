// A flight through the navigator: every reading as it was fed, and what comes of it.
import { Navigator, SENSOR, REASON, PACE, EQUIPMENT, ROWS, DEFAULT_SETTINGS } from "../flownav.js";
import * as figures from "./figures.js";

const VALUES = 6, VARIANCES = 3, GPS = [SENSOR.GPS_POSITION, SENSOR.GPS_VELOCITY];

// The rows of the longest of a record's navigators.
export function longest(fed) {
  if (!fed.segment) return [...fed.t_s.keys()];
  const by = new Map();
  fed.segment.forEach((segment, i) => { if (!by.has(segment)) by.set(segment, []); by.get(segment).push(i); });
  return [...by.values()].reduce((most, rows) => (rows.length > most.length ? rows : most), []);
}

const number = (value) => (typeof value === "string" ? Number(value) : Number(value));

// Settings as a replay has them: nothing waits, no time is doubted. segment: the equipment that a record states.
export function settingsFor(segment) {
  const settings = Float64Array.from(DEFAULT_SETTINGS);
  settings[PACE.horizon_s] = 0; settings[PACE.leap_s] = Infinity; settings[PACE.anew_s] = Infinity; settings[PACE.start_wait_s] = NaN;
  for (const name of ["deadline_s", "declination_rad"]) if (segment && name in segment) settings[EQUIPMENT[name]] = number(segment[name]);
  return settings;
}

// Feed rows of what was fed. cut: [t0, t1], in which GPS is withheld. heard: asked every so many readings to let the page draw.
export async function fuse(bytes, fed, rows, segment, cut, heard = async () => {}) {
  const nav = await Navigator.load(bytes, settingsFor(segment)), at = nav.at.work / 8;
  const estimates = [], innovations = [], events = [], column = (name, usual) => fed[name] ?? new Float64Array(fed.t_s.length).fill(usual);
  const arrival = column("arrival_s", NaN), quality = column("quality", 255), withheld = column("withheld", 0), arrived = column("arrived", 1);
  const value = Array.from({ length: VALUES }, (_, k) => column(`value_${k}`, NaN));
  const variance = Array.from({ length: VARIANCES }, (_, k) => column(`variance_${k}`, NaN));
  let last = nav.memory[at + ROWS.last_estimate], done = 0;
  for (const i of rows) {
    const sensor = fed.sensor[i], when = Number.isNaN(arrival[i]) ? fed.t_s[i] : arrival[i];
    const taken = cut && GPS.includes(sensor) && when >= cut[0] && when < cut[1];
    let outcome = nav.take(fed.t_s[i], sensor, value.map((c) => c[i]), {
      variance: variance.map((c) => c[i]), quality: quality[i], withheld: arrived[i] > 0 ? (taken ? 1 : withheld[i]) : 2,
    });
    while (outcome.parts > 0 || outcome.waiting > 0) {
      innovations.push(...outcome.innovations); events.push(...outcome.events);
      outcome = nav.work();
      if (outcome.parts === 0) break;
    }
    innovations.push(...outcome.innovations); events.push(...outcome.events);
    const due = nav.memory[at + ROWS.last_estimate];
    if (due !== last) { last = due; const state = nav.now(due); if (state) estimates.push(state); }
    if (++done % 2000 === 0) await heard(done / rows.length);
  }
  return { estimates, innovations, events, digest: nav.digest() };
}

// -- what it says -----------------------------------------------------------------------------------------------
function velocityNe(row) { // the body's, in earth's axes, as a record's reader turns it
  const [w, x, y, z] = row.quaternion, [u, v, d] = row.vel_frd_m_s;
  return [
    (1 - 2 * (y * y + z * z)) * u + 2 * (x * y - w * z) * v + 2 * (x * z + w * y) * d,
    2 * (x * y + w * z) * u + (1 - 2 * (x * x + z * z)) * v + 2 * (y * z - w * x) * d,
  ];
}

// A sensor's readings as they arrived.
function stream(fed, sensor, columns) {
  const arrival = fed.arrival_s ?? fed.t_s;
  const rows = [...fed.t_s.keys()].filter((i) => fed.sensor[i] === sensor && !(fed.arrived && fed.arrived[i] <= 0)).sort((a, b) => arrival[a] - arrival[b] || a - b);
  return { t: rows.map((i) => arrival[i]), columns: Array.from({ length: columns }, (_, k) => rows.map((i) => fed[`value_${k}`][i])) };
}

export function scores(flown, fed, truth, delayS, cut) {
  const path = { t: flown.estimates.map((row) => row.t_s), columns: [0, 1, 2].map((k) => flown.estimates.map((row) => row.pos_ned_m[k])) };
  const moving = flown.estimates.map(velocityNe), velocity = { t: path.t, columns: [0, 1].map((k) => moving.map((row) => row[k])) };
  const fixes = stream(fed, SENSOR.GPS_POSITION, 3), speeds = stream(fed, SENSOR.GPS_VELOCITY, 2);
  const known = speeds.t.map((_, i) => i).filter((i) => speeds.columns.every((c) => Number.isFinite(c[i])));
  const told = { t: known.map((i) => speeds.t[i] - delayS), columns: speeds.columns.map((c) => known.map((i) => c[i])) };
  const against = truth ? figures.truthScores(path, velocity, truth) : null;
  const { error, moved, ...said } = against ?? {};
  return {
    numbers: {
      digest: flown.digest, estimates: path.t.length,
      outages: cut && fixes.t.length ? [figures.outage(path, fixes, truth, delayS, cut)] : [],
      velocity_rms_m_s: told.t.length ? figures.horizontalRms(velocity, told) : null,
      ...(against ? { truth: said } : {}),
      protection: figures.protection(flown.estimates),
      ...figures.innovationScores(flown.innovations, stream(fed, SENSOR.LANDED, 1), SENSOR, REASON),
    },
    path, error, moved,
  };
}
