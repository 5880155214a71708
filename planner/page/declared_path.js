/* The declared path: the drawn path made feasible for the robot.
 *
 * Mirrors planner/planning/declared_path.py. Lengths in l. */
import { largestSize } from "./arrays.js";
import { TIGHTEST, feasible, placeOfLargest, spacingOf } from "./feasible.js";
import { general, pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { remedy } from "./remedy.js";
import { reference } from "./tractrix.js";
import { extent, inLab, placeInLab } from "./units.js";
import { pivotRadius, turnRadius } from "./vehicle.js";

const CORNERS = ["nearest", "minimax", "fillet", "error"];
const WARN = 0.1; // share of the extent; a declared path that is further off gets a warning
const FAR = 0.3; // l; so does one that is further off than this

/* Choose the path that the robot will follow: {reference, curvature, offDrawn, missed, warnings}.
 *
 * curvature: largest of the pivot's reference. offDrawn: largest distance of a declared point from the drawn path;
 * missed: of a drawn point from the declared path. */
function declare(raw, feasibility, progress = null) {
  const { corner, timeWeight, robot } = feasibility;
  if (!CORNERS.includes(corner)) {
    throw new InputError(`corner ${pythonText(corner)}; allowed are ${CORNERS.join(", ")}`, "options");
  }
  if (!(Number.isFinite(timeWeight) && timeWeight >= 0)) {
    throw new InputError(`time weight ${general(timeWeight)}; give a number of l², 0 or more`, "options");
  }
  if (timeWeight && corner !== "nearest" && corner !== "minimax") {
    throw new InputError(`a time weight needs corner = nearest or minimax, not ${corner}`, "options");
  }
  const accepted = feasible(raw, feasibility, progress);
  if (accepted === null) throw new InputError(tooTight(raw, feasibility, progress));
  const { reference: followed, offDrawn, missed } = accepted, warnings = [];
  const distance = Math.max(offDrawn, missed), size = Math.max(...extent(raw));
  if (distance > WARN * size) {
    warnings.push(
      `the shape is lost in part: the declared path is up to ${inLab(distance, robot)} from the drawn one, ` +
        `which is ${inLab(size, robot)} across; draw it larger`,
    );
  } else if (distance > FAR) {
    warnings.push(
      `the declared path leaves the drawn one by up to ${inLab(distance, robot)}, where the robot cannot turn ` +
        "so tightly; draw wider turns",
    );
  }
  return { reference: followed, curvature: largestSize(followed.curvature), offDrawn, missed, warnings };
}

/* Say where a path is too tight, and what to change. */
function tooTight(raw, feasibility, progress) {
  const { robot, vehicle, rod, drift } = feasibility, drawn = reference(raw, rod, spacingOf(raw), drift);
  const curvature = drawn.curvature.map(Math.abs), worst = placeOfLargest(curvature);
  const within = inLab(pivotRadius(vehicle) / TIGHTEST, robot), circle = inLab(turnRadius(vehicle), robot);
  return (
    `path too tight at ${placeInLab(...drawn.p[worst], robot)}: the pivot would turn with radius ` +
    `${inLab(1 / curvature[worst], robot)}, the robot can with ${within}; its circle has radius ${circle}, and ` +
    `the nearest path that it can follow has lost the shape; ${remedy(raw, feasibility, progress)}`
  );
}

export { CORNERS, declare };
