// Zstandard frames to bytes: RFC 8878. The pages of a record's tables are such frames.

const LENGTHS = { // of literals, of matches: the code's least value and how many bits follow
  LL: [[...Array(16).keys()], Array(16).fill(0)],
  ML: [Array.from({ length: 32 }, (_, i) => i + 3), Array(32).fill(0)],
};
for (const [least, bits] of [[16, 1], [18, 1], [20, 1], [22, 1], [24, 2], [28, 2], [32, 3], [40, 3], [48, 4], [64, 6], [128, 7],
  [256, 8], [512, 9], [1024, 10], [2048, 11], [4096, 12], [8192, 13], [16384, 14], [32768, 15], [65536, 16]]) {
  LENGTHS.LL[0].push(least); LENGTHS.LL[1].push(bits);
}
for (const [least, bits] of [[35, 1], [37, 1], [39, 1], [41, 1], [43, 2], [47, 2], [51, 3], [59, 3], [67, 4], [83, 4], [99, 5],
  [131, 7], [259, 8], [515, 9], [1027, 10], [2051, 11], [4099, 12], [8195, 13], [16387, 14], [32771, 15], [65539, 16]]) {
  LENGTHS.ML[0].push(least); LENGTHS.ML[1].push(bits);
}
const ones = (count) => Array(count).fill(1), lows = (count) => Array(count).fill(-1);
const USUAL = {
  LL: [6, [4, 3, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 2, 1, 1, 1, 1, 1, ...lows(4)]],
  OF: [5, [...ones(6), 2, 2, 2, ...ones(15), ...lows(5)]],
  ML: [6, [1, 4, 3, 2, 2, 2, 2, 2, 2, ...ones(37), ...lows(7)]],
};

// Bits that are read from the end of some bytes backwards; before their begin all are 0.
class Backwards {
  constructor(bytes) {
    if (!bytes.length || !bytes.at(-1)) throw new Error("zstd: a stream without an end");
    this.bytes = bytes;
    this.left = 8 * bytes.length - Math.clz32(bytes.at(-1)) + 23; // the highest bit that is set marks the end
  }
  peek(count) {
    let value = 0, from = this.left - count, have = 0;
    if (from < 0) { have = Math.min(-from, count); from = 0; }
    let found = 0, shift = 1;
    for (let need = count - have, at = from; need > 0;) {
      const within = at & 7, take = Math.min(8 - within, need);
      found += ((this.bytes[at >> 3] >> within) & ((1 << take) - 1)) * shift;
      shift *= 1 << take; at += take; need -= take;
    }
    value = found * 2 ** have;
    return value;
  }
  read(count) { const value = count ? this.peek(count) : 0; this.left -= count; return value; }
}

function decodingTable(accuracy, shares) {
  const size = 1 << accuracy, symbol = new Uint8Array(size), bits = new Uint8Array(size), base = new Uint16Array(size);
  const next = shares.map((share) => (share < 0 ? 1 : share));
  let high = size - 1, at = 0;
  shares.forEach((share, s) => { if (share < 0) symbol[high--] = s; });
  const step = (size >> 1) + (size >> 3) + 3;
  shares.forEach((share, s) => {
    for (let i = 0; i < share; i++) { symbol[at] = s; do at = (at + step) & (size - 1); while (at > high); }
  });
  for (let i = 0; i < size; i++) {
    const x = next[symbol[i]]++;
    bits[i] = accuracy - (31 - Math.clz32(x));
    base[i] = (x << bits[i]) - size;
  }
  return { accuracy, symbol, bits, base };
}

// A table as it stands in a stream, and how many bytes it takes.
function readTable(bytes, most) {
  let bit = 0;
  const peek = (count) => {
    let value = 0;
    for (let i = 0; i < count; i++) value |= ((bytes[(bit + i) >> 3] >> ((bit + i) & 7)) & 1) << i;
    return value;
  };
  const accuracy = peek(4) + 5;
  if (accuracy > most) throw new Error("zstd: a table is too fine");
  bit = 4;
  const shares = [];
  let remaining = (1 << accuracy) + 1, threshold = 1 << accuracy, width = accuracy + 1;
  while (remaining > 1 && shares.length < 256) {
    const spare = 2 * threshold - 1 - remaining, low = peek(width - 1);
    let count;
    if (low < spare) { count = low; bit += width - 1; } else {
      count = peek(width); bit += width;
      if (count >= threshold) count -= spare;
    }
    count -= 1;
    remaining -= Math.abs(count);
    shares.push(count);
    if (count === 0) {
      for (let more = 3; more === 3;) { more = peek(2); bit += 2; for (let i = 0; i < more; i++) shares.push(0); }
    }
    while (remaining < threshold && threshold > 1) { width -= 1; threshold >>= 1; }
  }
  if (remaining !== 1) throw new Error("zstd: a table is not whole");
  return [decodingTable(accuracy, shares), (bit + 7) >> 3];
}

function huffmanWeights(bytes) {
  const head = bytes[0];
  if (head >= 128) {
    const weights = Array.from({ length: head - 127 }, (_, i) => (bytes[1 + (i >> 1)] >> (i & 1 ? 0 : 4)) & 15);
    return [weights, 1 + ((head - 126) >> 1)];
  }
  const [table, size] = readTable(bytes.subarray(1, 1 + head), 6), stream = new Backwards(bytes.subarray(1 + size, 1 + head));
  const weights = [], states = [stream.read(table.accuracy), stream.read(table.accuracy)];
  for (let i = 0; weights.length < 256; i ^= 1) {
    weights.push(table.symbol[states[i]]);
    states[i] = table.base[states[i]] + stream.read(table.bits[states[i]]);
    if (stream.left < 0) { weights.push(table.symbol[states[i ^ 1]]); break; }
  }
  return [weights, 1 + head];
}

function huffmanTable(weights) {
  const sum = weights.reduce((total, w) => total + (w ? 1 << (w - 1) : 0), 0), most = 32 - Math.clz32(sum);
  const all = [...weights, 32 - Math.clz32((1 << most) - sum)];
  const symbol = new Uint8Array(1 << most), bits = new Uint8Array(1 << most);
  let at = 0;
  for (let w = 1; w <= most; w++) {
    all.forEach((weight, s) => {
      if (weight !== w) return;
      symbol.fill(s, at, at + (1 << (w - 1))); bits.fill(most + 1 - w, at, at + (1 << (w - 1)));
      at += 1 << (w - 1);
    });
  }
  return { most, symbol, bits };
}

function huffmanStream(table, bytes, out) {
  const stream = new Backwards(bytes);
  for (let i = 0; i < out.length; i++) {
    const found = stream.peek(table.most);
    out[i] = table.symbol[found];
    stream.left -= table.bits[found];
  }
}

function literals(bytes, kept) {
  const kind = bytes[0] & 3, form = (bytes[0] >> 2) & 3;
  if (kind < 2) {
    const head = form === 1 ? 2 : form === 3 ? 3 : 1;
    const size = head === 1 ? bytes[0] >> 3 : (bytes[0] >> 4) + (bytes[1] << 4) + (head === 3 ? bytes[2] << 12 : 0);
    if (kind === 0) return [bytes.subarray(head, head + size), head + size];
    return [new Uint8Array(size).fill(bytes[head]), head + 1];
  }
  const width = form < 2 ? 10 : form === 2 ? 14 : 18, head = form < 2 ? 3 : form + 2;
  let number = 0;
  for (let i = head - 1; i >= 0; i--) number = number * 256 + bytes[i];
  number = Math.floor(number / 16);
  const size = number % 2 ** width, stored = Math.floor(number / 2 ** width), out = new Uint8Array(size);
  let body = bytes.subarray(head, head + stored);
  if (kind === 2) {
    const [weights, used] = huffmanWeights(body);
    kept.huffman = huffmanTable(weights);
    body = body.subarray(used);
  }
  if (form === 0) huffmanStream(kept.huffman, body, out);
  else {
    const each = (size + 3) >> 2;
    let at = 6;
    for (let i = 0; i < 4; i++) {
      const end = i < 3 ? at + body[2 * i] + (body[2 * i + 1] << 8) : body.length;
      huffmanStream(kept.huffman, body.subarray(at, end), out.subarray(each * i, i < 3 ? each * (i + 1) : size));
      at = end;
    }
  }
  return [out, head + stored];
}

function tableOf(name, mode, bytes, kept) {
  if (mode === 0) kept[name] = decodingTable(...USUAL[name]);
  else if (mode === 1) {
    kept[name] = { accuracy: 0, symbol: Uint8Array.of(bytes[0]), bits: Uint8Array.of(0), base: Uint16Array.of(0) };
    return 1;
  } else if (mode === 2) {
    const [table, used] = readTable(bytes, name === "OF" ? 8 : 9);
    kept[name] = table;
    return used;
  }
  return 0;
}

function block(bytes, out, from, kept) {
  const [literal, used] = literals(bytes, kept);
  let at = used, count = bytes[at++], place = from, taken = 0;
  const copyLiterals = (size) => { out.set(literal.subarray(taken, taken + size), place); taken += size; place += size; };
  if (count > 127) {
    if (count < 255) count = ((count - 128) << 8) + bytes[at++];
    else { count = bytes[at] + (bytes[at + 1] << 8) + 0x7f00; at += 2; }
  }
  if (count) {
    const modes = bytes[at++];
    at += tableOf("LL", modes >> 6, bytes.subarray(at), kept);
    at += tableOf("OF", (modes >> 4) & 3, bytes.subarray(at), kept);
    at += tableOf("ML", (modes >> 2) & 3, bytes.subarray(at), kept);
    const stream = new Backwards(bytes.subarray(at)), { LL, OF, ML, offsets } = kept;
    let l = stream.read(LL.accuracy), o = stream.read(OF.accuracy), m = stream.read(ML.accuracy);
    for (let i = 0; i < count; i++) {
      const code = OF.symbol[o], value = 2 ** code + stream.read(code);
      const match = LENGTHS.ML[0][ML.symbol[m]] + stream.read(LENGTHS.ML[1][ML.symbol[m]]);
      const size = LENGTHS.LL[0][LL.symbol[l]] + stream.read(LENGTHS.LL[1][LL.symbol[l]]);
      if (i + 1 < count) {
        l = LL.base[l] + stream.read(LL.bits[l]);
        m = ML.base[m] + stream.read(ML.bits[m]);
        o = OF.base[o] + stream.read(OF.bits[o]);
      }
      let offset;
      if (value > 3) { offset = value - 3; offsets.unshift(offset); offsets.pop(); } else {
        const which = value - 1 + (size === 0 ? 1 : 0);
        offset = which < 3 ? offsets[which] : offsets[0] - 1;
        if (which > 0) { offsets.splice(Math.min(which, 2), 1); offsets.unshift(offset); }
      }
      copyLiterals(size);
      if (offset > place || place + match > out.length) throw new Error("zstd: a match lies outside");
      for (let k = 0; k < match; k++, place++) out[place] = out[place - offset];
    }
  }
  copyLiterals(literal.length - taken);
  return place;
}

// size: of what comes out, which the pages of a table state.
export function unzstd(bytes, size) {
  const out = new Uint8Array(size), view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (view.getUint32(0, true) !== 0xfd2fb528) throw new Error("zstd: not a frame");
  const head = bytes[4], single = (head >> 5) & 1;
  let at = 5 + (single ? 0 : 1) + [0, 1, 2, 4][head & 3] + [single, 2, 4, 8][head >> 6], place = 0, last = 0;
  const kept = { offsets: [1, 4, 8] };
  while (!last) {
    const told = bytes[at] + (bytes[at + 1] << 8) + (bytes[at + 2] << 16), kind = (told >> 1) & 3, length = told >> 3;
    last = told & 1;
    at += 3;
    if (kind === 0) { out.set(bytes.subarray(at, at + length), place); place += length; at += length; }
    else if (kind === 1) { out.fill(bytes[at], place, place + length); place += length; at += 1; }
    else if (kind === 2) { place = block(bytes.subarray(at, at + length), out, place, kept); at += length; }
    else throw new Error("zstd: no such block");
  }
  if (place !== size) throw new Error(`zstd: ${place} bytes in place of ${size}`);
  return out;
}
