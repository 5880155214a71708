/* The point of the robot's axis that is to follow a path.
 *
 * Mirrors planner/vehicle/tracked_point.py. Lengths in l. */
import { fixed, pythonText } from "./format.js";
import { tableVehicle, unmeasuredModes } from "./from_table.js";
import { InputError } from "./input_error.js";
import { pivotDistance } from "./vehicle.js";

const POINTS = ["head_centre", "head_tip", "pivot"];

/* Ask a table for the vehicle of a robot, and add the tracked point: {robot, vehicle, point, offset, model,
 * ownTable, calibrated, unmeasured, warnings}. tracked_vehicle
 *
 * offset: from the head's centre forward to the tracked point. model: hash of the table. ownTable: whether the
 * table is of this robot alone. unmeasured: modes of a robot whose coefficients are those of another. */
function trackedVehicle(robot, table, point) {
  const vehicle = tableVehicle(robot, table), unmeasured = unmeasuredModes(robot, table, vehicle);
  return trackedPoint(robot, { vehicle, unmeasured, calibrated: false, ownTable: false }, point, table.identity);
}

/* Add the tracked point to a vehicle; see `trackedVehicle`. */
function trackedPoint(robot, { vehicle, unmeasured, calibrated, ownTable }, point, model) {
  const offset = pointOffset(point, robot, vehicle), warnings = gapWarnings(vehicle);
  return { robot, vehicle, point, offset, model, ownTable, calibrated, unmeasured, warnings };
}

/* Distance from the pivot to the tracked point. TrackedVehicle.rod */
function rodOf({ vehicle, offset }) {
  return pivotDistance(vehicle) + offset;
}

function pointOffset(point, robot, vehicle) {
  if (point === "head_centre") return 0;
  if (point === "head_tip") return robot.headLength / 2 / robot.tailLength;
  if (point === "pivot") return -pivotDistance(vehicle);
  throw new InputError(`point ${pythonText(point)}; allowed are ${POINTS.join(", ")}`, "options");
}

/* Warnings about what the model leaves out for this robot. TrackedVehicle.warnings */
function gapWarnings({ tailGap, leastGap }) {
  if (tailGap >= leastGap) return [];
  const without = leastGap === 1 ? "the model has no contact" : "contact does not hold them apart";
  return [`tails touch (predicted gap ${fixed(tailGap, 2)} diameters): ${without}`];
}

export { POINTS, trackedVehicle, trackedPoint, rodOf, gapWarnings };
