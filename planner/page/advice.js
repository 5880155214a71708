/* What the command advises, in the words of the page's controls. */
import { general } from "./format.js";

const NUMBERS = 'under "Corners as numbers; move, scale, turn"';
const ADVICE = [ // what a message of the planner says, and what the page says instead
  ["choose one with --shape, or remove the others", "remove the others"],
  [/simulate this robot's own table \([^)]*\), or measure/, "measure"],
  [/give --smooth (\S+)/, 'set "Smooth over" to $1 cm and press "Smooth this path"'],
  [/scale the path by (\S+)/, `scale it by $1 ${NUMBERS}`],
  [/; scale it$/, `; scale it ${NUMBERS}`],
  ["allow corner = nearest", 'choose another answer to "Corners that are too tight"'],
  [/change the robot, or simulate it \([^)]*\)/, 'change it under "Robot"'],
  ["simulate it (softflagella replay)", 'set "Number of tails N" to 2 or more'],
  [/, or make a table of this robot with .*/, ' under "Largest stated error"'],
];

/* A message of the planner with its advice in the page's words; the lengths of smoothing become cm. */
function inPage(message, robot) {
  const cm = message.replace(/(?<=--smooth )(\S+)l/, (_, tails) => general(100 * robot.tailLength * tails, 3));
  return ADVICE.reduce((words, [from, to]) => words.replace(from, to), cm);
}

export { inPage };
