// A record of flownav (.fnr): a zip of Parquet tables, numbers only, each page of them a Zstandard frame or bare.
import { unzstd } from "./zstd.js";

// -- Thrift's compact protocol: structures as {field: value} ---------------------------------------------------
class Thrift {
  constructor(bytes, at = 0) { this.bytes = bytes; this.at = at; }
  varint() {
    let value = 0, scale = 1;
    for (;;) { const byte = this.bytes[this.at++]; value += (byte & 127) * scale; scale *= 128; if (byte < 128) return value; }
  }
  integer() { const value = this.varint(); return value % 2 ? -(value + 1) / 2 : value / 2; }
  text() { const size = this.varint(), from = this.at; this.at += size; return this.bytes.subarray(from, this.at); }
  value(kind) {
    switch (kind) {
      case 1: return true;
      case 2: return false;
      case 3: return this.bytes[this.at++];
      case 4: case 5: case 6: return this.integer();
      case 7: this.at += 8; return null;
      case 8: return this.text();
      case 9: case 10: return this.list();
      case 12: return this.structure();
      default: throw new Error(`Parquet: a value of kind ${kind}`);
    }
  }
  list() {
    const head = this.bytes[this.at++], count = head >> 4 === 15 ? this.varint() : head >> 4, kind = head & 15;
    return Array.from({ length: count }, () => (kind < 3 ? this.bytes[this.at++] === 1 : this.value(kind)));
  }
  structure() {
    const found = {};
    for (let field = 0; ;) {
      const head = this.bytes[this.at++];
      if (head === 0) return found;
      field = head >> 4 ? field + (head >> 4) : this.integer();
      found[field] = this.value(head & 15);
    }
  }
}

// -- columns -----------------------------------------------------------------------------------------------------
const DOUBLE = 5, ZSTD = 6, PLAIN = 0, DICTIONARY_PAGE = 2;

// Runs and packed groups of small numbers (RLE_DICTIONARY and levels).
function hybrid(bytes, from, width, count) {
  const out = new Uint32Array(count), reader = new Thrift(bytes, from);
  for (let n = 0; n < count;) {
    const head = reader.varint();
    if (head & 1) {
      const many = (head >> 1) * 8, begin = 8 * reader.at;
      for (let i = 0; i < many && n < count; i++, n++) {
        let value = 0;
        for (let b = 0; b < width; b++) { const bit = begin + i * width + b; value |= ((bytes[bit >> 3] >> (bit & 7)) & 1) << b; }
        out[n] = value;
      }
      reader.at += (head >> 1) * width;
    } else {
      let value = 0;
      for (let b = 0; b < (width + 7) >> 3; b++) value |= bytes[reader.at++] << (8 * b);
      for (let i = head >> 1; i > 0 && n < count; i--) out[n++] = value;
    }
  }
  return out;
}

const doubles = (bytes, from, count) => new Float64Array(bytes.slice(from, from + 8 * count).buffer);

function column(bytes, meta, rows) {
  const out = new Float64Array(rows).fill(NaN);
  let at = meta[11] || meta[9], done = 0, dictionary = null;
  while (done < rows) {
    const reader = new Thrift(bytes, at), head = reader.structure(), stored = bytes.subarray(reader.at, reader.at + head[3]);
    const page = meta[4] === ZSTD ? unzstd(stored, head[2]) : stored;
    at = reader.at + head[3];
    if (head[1] === DICTIONARY_PAGE) { dictionary = doubles(page, 0, head[7][1]); continue; }
    const count = head[5][1], size = new DataView(page.buffer, page.byteOffset).getUint32(0, true);
    const present = hybrid(page, 4, 1, count);
    const known = present.reduce((sum, one) => sum + one, 0);
    const values = head[5][2] === PLAIN
      ? doubles(page, 4 + size, known)
      : Array.from(hybrid(page, 5 + size, page[4 + size], known), (place) => dictionary[place]);
    for (let i = 0, k = 0; i < count; i++) if (present[i]) out[done + i] = values[k++];
    done += count;
  }
  return out;
}

// A table's columns of numbers by name; others are left out.
export function parquet(bytes) {
  const length = new DataView(bytes.buffer, bytes.byteOffset).getUint32(bytes.length - 8, true);
  const footer = new Thrift(bytes, bytes.length - 8 - length).structure(), found = {};
  for (const group of footer[4]) {
    for (const { 3: meta } of group[1]) {
      const name = new TextDecoder().decode(meta[3][0]);
      if (meta[1] !== DOUBLE) continue;
      const part = column(bytes, meta, group[3]), before = found[name];
      found[name] = before ? Float64Array.from([...before, ...part]) : part;
    }
  }
  return found;
}

// -- the zip -------------------------------------------------------------------------------------------------------
export function members(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let end = bytes.length - 22;
  while (end >= 0 && view.getUint32(end, true) !== 0x06054b50) end--;
  if (end < 0) throw new Error("not a record of flownav: no zip");
  const found = {};
  for (let at = view.getUint32(end + 16, true), n = view.getUint16(end + 10, true); n > 0; n--) {
    const size = view.getUint32(at + 20, true), name = view.getUint16(at + 28, true), place = view.getUint32(at + 42, true);
    if (view.getUint16(at + 10, true) !== 0) throw new Error("not a record of flownav: its zip is packed");
    const begin = place + 30 + view.getUint16(place + 26, true) + view.getUint16(place + 28, true);
    found[new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name))] = bytes.subarray(begin, begin + size);
    at += 46 + name + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
  }
  return found;
}

// A record: its manifest, and what a navigator was fed and the truth, columns by name.
export function readRecord(bytes) {
  const files = members(bytes);
  if (!files["manifest.json"] || !files["fed.parquet"]) {
    throw new Error("it does not say what a navigator was fed; `flownav fly` and `flownav live --record` write records that do");
  }
  const manifest = JSON.parse(new TextDecoder().decode(files["manifest.json"]).replace(/-?\bInfinity\b|\bNaN\b/g, (word) => `"${word}"`));
  return { manifest, fed: parquet(files["fed.parquet"]), truth: files["truth.parquet"] ? parquet(files["truth.parquet"]) : null };
}

// The same of a CSV file with a line of names, as `flownav export --to csv` writes the table `fed`.
export function readCsv(text) {
  const [names, ...lines] = text.trim().split(/\r?\n/).map((line) => line.split(","));
  if (!["t_s", "sensor", "value_0"].every((name) => names.includes(name))) throw new Error("the CSV file lacks t_s, sensor or value_0");
  const fed = {};
  names.forEach((name, i) => { fed[name] = Float64Array.from(lines, (cells) => (cells[i] === "" || cells[i] === undefined ? NaN : Number(cells[i]))); });
  return { manifest: null, fed, truth: null };
}
