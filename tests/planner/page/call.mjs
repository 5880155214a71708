/* Calls functions of the page's core: JSON in, [[file, function, arguments], …], and JSON out, their answers.
 *
 * A refusal is {refusal: message}. Numbers that JSON lacks are written as words in an object, typed arrays in base
 * 64, {map: entries} is a Map. The argument "@table" stands for the look-up table that is given as text; {call: [file, function, arguments]}
 * stands for the answer of another call. */
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

function plain(key, value) {
  if (leftOut?.includes(key)) return undefined;
  if (ArrayBuffer.isView(value)) return { floats: Buffer.from(Float64Array.from(value).buffer).toString("base64") };
  if (typeof value === "number" && !Number.isFinite(value)) return { number: String(value) };
  return value === undefined ? null : value;
}

function typed(key, value) {
  if (typeof value?.number === "string") return Number(value.number);
  if (Array.isArray(value?.map)) return new Map(value.map);
  if (!value?.floats) return value;
  return new Float64Array(Uint8Array.from(Buffer.from(value.floats, "base64")).buffer);
}

async function called([file, name, given]) {
  const core = await import(`${pathToFileURL(folder)}/${file}`), words = [];
  for (const argument of given) {
    if (argument === "@table") words.push(table);
    else words.push(argument?.call ? await called(argument.call) : argument);
  }
  return core[name](...words);
}

const { folder, calls, table: text, leftOut } = JSON.parse(readFileSync(0, "utf8"), typed);
const table = text && (await (await import(`${pathToFileURL(folder)}/lookup.js`)).readTable(JSON.parse(text)));
const answers = [];
for (const call of calls) {
  try {
    answers.push({ answer: await called(call) });
  } catch (refusal) {
    if (!(refusal.name in { InputError: 0, OutsideError: 0 })) throw refusal;
    answers.push({ refusal: refusal.message });
  }
}
process.stdout.write(JSON.stringify(answers, plain));
