/* Texts of files, and the numbers of a look-up table or of a vehicle, as Python has written them into the page
 * (write_page.py has the format).
 *
 * A tensor becomes {shape, values}, with all values in one Float64Array, the last axis fastest. */
import { InputError } from "./words.js";

const LETTERS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%:()*+-;,=.?@^_/{|}~";

/* Read what `packed_data` has written, from the object that its JSON stands for; flat: tensors become their values. */
async function readData({ numbers, ...plain }, flat = false) {
  const byPlace = new Uint8Array(await inflated(numbers).arrayBuffer()), count = byPlace.length / 8;
  const bytes = new Uint8Array(8 * count);
  for (let place = 0; place < 8; place++) {
    for (let i = 0; i < count; i++) bytes[8 * i + place] = byPlace[place * count + i];
  }
  return withTensors(plain, new Float64Array(bytes.buffer), flat);
}

/* The text of a file, which must be text. */
function textOf(bytes, name) {
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new InputError(`${name} is no text in UTF-8`);
  }
}

/* What `packed_bytes` has written, as the body of a response. */
function inflated(text) {
  return new Response(new Blob([base85Bytes(text)]).stream().pipeThrough(new DecompressionStream("deflate")));
}

/* The bytes of a text in base 85: five letters hold four bytes, a shorter rest holds one byte less than letters. */
function base85Bytes(text) {
  const digits = new Uint8Array(128).fill(84), whole = Math.ceil(text.length / 5);
  for (let i = 0; i < LETTERS.length; i++) digits[LETTERS.charCodeAt(i)] = i;
  const bytes = new DataView(new ArrayBuffer(4 * whole)), padded = text.padEnd(5 * whole, "~");
  for (let i = 0; i < whole; i++) {
    let value = 0;
    for (let k = 5 * i; k < 5 * i + 5; k++) value = 85 * value + digits[padded.charCodeAt(k)];
    bytes.setUint32(4 * i, value);
  }
  return new Uint8Array(bytes.buffer, 0, 4 * whole - (5 * whole - text.length));
}

function withTensors(part, numbers, flat) {
  if (Array.isArray(part)) return part.map((value) => withTensors(value, numbers, flat));
  if (part === null || typeof part !== "object") return part;
  if ("tensor" in part) {
    const size = part.tensor.reduce((product, length) => product * length, 1);
    const values = numbers.subarray(part.at, part.at + size);
    return flat ? values : { shape: part.tensor, values };
  }
  return Object.fromEntries(Object.entries(part).map(([name, value]) => [name, withTensors(value, numbers, flat)]));
}

export { inflated, readData, textOf };
