/* Digests that files carry of their own content, so that damage and edits are noticed.
 *
 * Mirrors sim/io/seals.py, and `plan_id` of sim/model/plan_file.py. */
import { InputError } from "./input_error.js";
import { sha256 } from "./sha256.js";

const FIRST = "# The last line is a digest of the others: a reader notices whether the file is whole.";
const LAST = /^# digest: ([0-9a-f]{11})[ \t\r]*$\n?/m;
const ID = /^p[0-9a-f]{11}$/; // ids of older versions have another form
const TOKEN = /"(?:[^"\\]|\\.)*"|[^\s,:[\]{}"]+|[,:[\]{}]/g; // of JSON

/* Eleven characters that name a text. digest_of */
function digestOf(text) {
  return sha256(text).slice(0, 11);
}

/* Refuse the text of a plan.json whose id is not that of its content. */
function checkPlanId(id, text, name) {
  const found = planId(text);
  if (id === found || !ID.test(id)) return;
  throw new InputError(
    `${name} was edited or damaged after it was written: the id of its content is ${found}, not ${id}; plan ` +
      "again, or delete the id to read the file as it is",
  );
}

/* The id of the text of a plan.json: entries but id and code_version, as Python's json.dumps writes them. */
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

/* Whether a text is whole and as it was written; one without a digest is. check_seal */
function isWhole(text) {
  const stated = LAST.exec(text), lines = text.replace(LAST, "").split("\n");
  if (!stated) return !text.startsWith(FIRST);
  return stated[1] === digestOf(lines.map((line) => line.replace(/[ \t\r]+$/, "")).join("\n").replace(/\n+$/, ""));
}

export { checkPlanId, isWhole };
