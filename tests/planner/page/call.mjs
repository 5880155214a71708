/* Calls functions of the page's core, as long as its input lasts: each line is {calls: [[file, function, arguments],
 * …], leftOut: names}, and is answered by a line with the answers. Arguments of the program: the core's folder and
 * the file of the look-up table.
 *
 * A refusal is {refusal: message}. Numbers that JSON lacks are written as words in an object, typed arrays in base
 * 64, {map: entries} is a Map. The argument "@table" stands for the look-up table; {call: [file, function,
 * arguments]} stands for the answer of another call. */
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";

const [, , folder, tableFile] = process.argv;
const module = (file) => import(`${pathToFileURL(folder)}/${file}`);
let table = null;

function plain(leftOut) {
  return (key, value) => {
    if (leftOut.includes(key)) return undefined;
    if (ArrayBuffer.isView(value)) return { floats: Buffer.from(Float64Array.from(value).buffer).toString("base64") };
    if (typeof value === "number" && !Number.isFinite(value)) return { number: String(value) };
    return value === undefined ? null : value;
  };
}

function typed(key, value) {
  if (typeof value?.number === "string") return Number(value.number);
  if (Array.isArray(value?.map)) return new Map(value.map);
  if (!value?.floats) return value;
  return new Float64Array(Uint8Array.from(Buffer.from(value.floats, "base64")).buffer);
}

async function lookUpTable() {
  return (table ??= await (await module("table.js")).readTable(JSON.parse(readFileSync(tableFile, "utf8"))));
}

async function called([file, name, given]) {
  const core = await module(file), words = [];
  for (const argument of given) {
    if (argument === "@table") words.push(await lookUpTable());
    else words.push(argument?.call ? await called(argument.call) : argument);
  }
  return core[name](...words);
}

async function answered(call) {
  try {
    return { answer: await called(call) };
  } catch (refusal) {
    if (refusal.name in { InputError: 0, BlockedError: 0, OutsideError: 0 }) return { refusal: refusal.message };
    return { broken: `${call[0]}, ${call[1]}: ${refusal.stack}` };
  }
}

for await (const line of createInterface({ input: process.stdin })) {
  const { calls, leftOut } = JSON.parse(line, typed), answers = [];
  for (const call of calls) answers.push(await answered(call));
  process.stdout.write(`${JSON.stringify(answers, plain(leftOut))}\n`);
}
