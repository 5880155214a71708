/* Style sheets of drawings: rules for kinds of elements, classes and ids, and which of them hold for an element.
 *
 * Mirrors planner/paths/style_sheet.py. A rule is {kind, names, given, weight}. */
import { pythonText } from "./format.js";
import { InputError } from "./input_error.js";

const COMMENT = /\/\*[^]*?\*\/|<!--|-->/g;
const NO_RULE = /@(?:charset|namespace)[^;{}]*;|@font-face\s*\{[^{}]*\}/gi;
const RULE = /([^{}]*)\{([^{}]*)\}/g;
const SELECTOR = /^(\*|[\p{L}\p{N}_-]*)((?:[.#][\p{L}\p{N}_-]+)*)$/u;
const IMPORTANT = /\s*!\s*important$/i;

/* Read the rules that declare one of the `known` properties, the weakest first. */
function readStyleSheet(text, known) {
  const bare = text.replace(COMMENT, "").replace(NO_RULE, ""), rest = bare.replace(RULE, "").trim(), rules = [];
  if (rest) {
    throw new InputError(`<style> is not read from ${pythonText(rest.slice(0, 30))} on; write attributes instead`);
  }
  for (const [, selectors, body] of bare.matchAll(RULE)) {
    const given = Object.fromEntries(Object.entries(declarations(body)).filter(([name]) => known.has(name)));
    if (!Object.keys(given).length) continue;
    for (const selector of selectors.split(",").map((word) => word.trim())) {
      const found = SELECTOR.exec(selector);
      if (!found || IMPORTANT.test(body.trim().replace(/;+$/, ""))) {
        throw new InputError(
          `<style> sets ${Object.keys(given).join(", ")} of ${pythonText(selector)}; read are kinds, classes ` +
          `and ids, ` +
            "without !important; write attributes instead",
        );
      }
      const names = found[2].match(/[.#][^.#]+/g) ?? [], ids = names.filter((name) => name.startsWith("#")).length;
      const weight = 1e6 * ids + 10 * (names.length - ids) + (found[1] && found[1] !== "*" ? 1 : 0);
      rules.push({ kind: found[1], names, given, weight });
    }
  }
  return rules.sort((a, b) => a.weight - b.weight);
}

/* What rules declare for an element. */
function declared(rules, kind, attributes) {
  const classes = (attributes.class ?? "").split(/\s+/).map((name) => `.${name}`);
  const own = new Set([...classes, `#${attributes.id}`]), found = {};
  for (const rule of rules) {
    if (["", "*", kind].includes(rule.kind) && rule.names.every((name) => own.has(name))) {
      Object.assign(found, rule.given);
    }
  }
  return found;
}

/* Read the declarations of a rule, or of the attribute style. */
function declarations(text) {
  const found = {};
  for (const part of text.replace(COMMENT, "").split(";")) {
    const at = part.indexOf(":");
    if (at >= 0) found[part.slice(0, at).trim().toLowerCase()] = part.slice(at + 1).trim().replace(IMPORTANT, "");
  }
  return found;
}

export { readStyleSheet, declared, declarations };
