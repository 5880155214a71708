/* The one file that a user drops or chooses, and what is wrong with it. */

import { InputError, refusing } from "../words.js";
import { byId, say } from "./dom.js";
import { drawingTree } from "./drawing.js";

const MOST_BYTES = 20e6;

/* Read it: {name, bytes, tree}, the tree of a drawing, or {refusal}; null: there is none. */
async function oneFile(files) {
  if (files.length === 0) return null;
  if (files.length > 1) return { refusal: "Give one file at a time." };
  const [{ name, size }] = files;
  if (size > MOST_BYTES) {
    const limit = `${MOST_BYTES / 1e6} MB`;
    return { refusal: `${name} has ${Math.round(size / 1e6)} MB; the page reads up to ${limit}.` };
  }
  const bytes = await files[0].arrayBuffer().catch(() => null); // null: of a folder, or of a file that is gone
  if (bytes === null) return { refusal: `${name} cannot be read; give a file.` };
  if (!/\.svg$/i.test(name)) return { name, bytes };
  return refusing(() => ({ name, tree: drawingTree(textOf(bytes, name), name) }), ({ message }) => ({ refusal: message }));
}

function textOf(bytes, name) {
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new InputError(`${name} is no text in UTF-8`);
  }
}

/* What is wrong with the last file, beside the part of the page that it is for; the next file takes it away. */
class FileProblem {
  constructor() {
    this.place = null;
    this.words = "";
  }

  /* Say it beside a part, such as path; empty words: nothing is wrong. */
  tell(part, words) {
    if (this.place?.textContent === this.words) say(this.place, "", true);
    this.place = byId(`${part}-problem`);
    this.words = words;
    if (words) say(this.place, words, true);
  }
}

export { FileProblem, oneFile };
