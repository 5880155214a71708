/* Digests that files carry of their own content, so that damage and edits are noticed: SHA-256 (FIPS 180-4), which a
 * page that was opened from a folder has not from its browser. */
import { InputError, trimmedEnd } from "./words.js";

const PRIMES = Array.from({ length: 310 }, (_, i) => i + 2).filter((n, _, all) => all.every((p) => p * p > n || n % p));
const fraction = (value) => ((value - Math.floor(value)) * 2 ** 32) >>> 0; // the first 32 bits after the point
const ROUNDS = PRIMES.slice(0, 64).map((prime) => fraction(Math.cbrt(prime)));
const START = PRIMES.slice(0, 8).map((prime) => fraction(Math.sqrt(prime)));
const FIRST = "# The last line is a digest of the others: a reader notices whether the file is whole.";
const LAST = /^# digest: ([0-9a-f]{11})[ \t\r]*$\n?/m;
const ID = /^p[0-9a-f]{11}$/; // ids of older versions have another form
const TOKEN = /"(?:[^"\\]|\\.)*"?|[^\s,:[\]{}"]+|[,:[\]{}]/g; // of JSON

/* Eleven characters that name a text: the first of its digest. */
function digestOf(text) {
  const bytes = new TextEncoder().encode(text), length = bytes.length;
  const padded = new Uint8Array((Math.floor((length + 8) / 64) + 1) * 64), view = new DataView(padded.buffer);
  padded.set(bytes);
  padded[length] = 0x80;
  view.setBigUint64(padded.length - 8, BigInt(length) * 8n);
  const state = Uint32Array.from(START), words = new Uint32Array(64);
  for (let at = 0; at < padded.length; at += 64) {
    for (let i = 0; i < 16; i++) words[i] = view.getUint32(at + 4 * i);
    addBlock(state, words);
  }
  return Array.from(state.slice(0, 2), (word) => word.toString(16).padStart(8, "0")).join("").slice(0, 11);
}

/* Add a block, whose first 16 words are given, to the state. */
function addBlock(state, words) {
  const mixed = (word, one, two, three) => turned(word, one) ^ turned(word, two) ^ three;
  for (let i = 16; i < 64; i++) {
    const early = words[i - 15], late = words[i - 2];
    words[i] = words[i - 16] + mixed(early, 7, 18, early >>> 3) + words[i - 7] + mixed(late, 17, 19, late >>> 10);
  }
  let [a, b, c, d, e, f, g, h] = state;
  for (let i = 0; i < 64; i++) {
    const choice = (e & f) ^ (~e & g), majority = (a & b) ^ (a & c) ^ (b & c);
    const first = (h + mixed(e, 6, 11, turned(e, 25)) + choice + ROUNDS[i] + words[i]) | 0;
    const second = (mixed(a, 2, 13, turned(a, 22)) + majority) | 0;
    [h, g, f, e, d, c, b, a] = [g, f, e, (d + first) | 0, c, b, a, (first + second) | 0];
  }
  [a, b, c, d, e, f, g, h].forEach((word, i) => (state[i] += word));
}

function turned(word, bits) {
  return (word >>> bits) | (word << (32 - bits));
}

/* Refuse the text of a plan.json whose id is not that of its content. */
function checkPlanId(id, text, name) {
  const found = planId(text);
  if (id === found || !ID.test(id)) return;
  throw new InputError(
    `${name} was edited or damaged after it was written: the id of its content is ${found}, not ${id}; plan again, or `
    + "delete the id to read the file as it is",
  );
}

/* The id of the text of a plan.json: entries but id and code_version, as Python writes them. */
function planId(text) {
  const entries = [""], spaced = { ",": ", ", ":": ": " };
  let depth = 0;
  for (const token of text.match(TOKEN) ?? []) {
    if (token === "]" || token === "}") depth -= 1;
    if (depth === 1 && token === ",") entries.push("");
    else if (depth >= 1) entries[entries.length - 1] += spaced[token] ?? token;
    if (token === "[" || token === "{") depth += 1;
  }
  const kept = entries.filter((entry) => !/^"(id|code_version)": /.test(entry));
  return `p${digestOf(`{${kept.join(", ")}}`)}`;
}

/* Whether a text is whole and as it was written; one without a digest is. */
function isWhole(text) {
  const stated = LAST.exec(text), lines = text.replace(LAST, "").split("\n");
  if (!stated) return !text.startsWith(FIRST);
  return stated[1] === digestOf(trimmedEnd(lines.map((line) => trimmedEnd(line, " \t\r")).join("\n"), "\n"));
}

export { planId, checkPlanId, isWhole };
