/* The planner in a worker: {id, what, content} comes in, and {id, answer}, {id, refusal, about} or {id, progress} go
 * out.
 *
 * The first message is {what: "start", content: the planner's data}. Errors of the program go out as `broken`. */
import { service } from "./service.js";
import { InputError, inPage } from "./words.js";

const PAUSE = 100; // ms between two words of progress

let answers = null;

async function answerTo({ id, what, content }) {
  if (what === "start") {
    answers = service(content);
    return;
  }
  let told = performance.now();
  const progress = (stage, done) => {
    if (performance.now() - told < PAUSE) return;
    told = performance.now();
    postMessage({ id, progress: { stage, done } });
  };
  try {
    postMessage({ id, answer: await (await answers)[what](content, progress) });
  } catch (error) {
    const refused = error instanceof InputError, robot = content.robot ?? content.wish?.robot;
    postMessage({
      id,
      refusal: refused ? inPage(error.message, robot) : "this cannot be planned",
      about: error.about ?? null,
      broken: refused ? null : String(error.stack ?? error),
    });
  }
}

onmessage = ({ data }) => answerTo(data);
