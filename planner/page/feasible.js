/* Paths that a robot can follow, near a path that it cannot follow as it was drawn.
 *
 * Mirrors planner/planning/feasible.py. Feasibility is {robot, vehicle, rod, drift, corner, timeWeight}: rod from
 * the pivot to the tracked point, drift what carries the robot off its heading. Lengths in l. */
import { largest, largestSize } from "./arrays.js";
import { twoSided } from "./distance.js";
import { CORNER, fillet, kinks, largestFillet } from "./fillets.js";
import { fixed, general } from "./format.js";
import { InputError } from "./input_error.js";
import { nearestPath, poseSpacing } from "./nearest_feasible.js";
import { pathLength, polyline, smoothed } from "./path.js";
import { DECLARING, tell } from "./progress.js";
import { reference } from "./tractrix.js";
import { extent, placeInLab } from "./units.js";
import { pivotRadius, turnRadius } from "./vehicle.js";

const AS_DRAWN = 0.85; // share of the pivot's largest curvature up to which a path is followed as it was drawn
const ROOMS = [0.92, 0.85, 0.7, 0.55, 0.35, 0.2]; // shares of it that the nearest path may use
const TIGHTEST = 0.95; // a reference that needs more than this share is refused
const LOST = 0.3; // share of the drawn path's extent; a declared path that is further off is refused
const ROUNDED = 0.0; // the way that rounds corners
const SMALL = 0.1; // of the path's extent: what smoothing may move a path that is noisy
const NOISY = 1.5; // ratio of a path's length to that of the smoothed path
const FEWEST_POSES = 5; // of the nearest path; a path with fewer is too small for such turns
const FILLET_ROOM = 0.7;
const SPACING = 0.02; // of points on the reference, in l
const MOST_POINTS = 150_000;
const MINIMAX = 3.4; // cost of the minimax distance over that of the root mean square
const ROUNDING = 1e-9; // relative
const POINTS_A_POSE = 80; // points of a reference that cost as much as one pose of the nearest path

/* Ways to change a path, in order of preference: ROUNDED, or shares of ROOMS. Feasibility.ways */
function waysOf({ corner }) {
  if (corner === "error") return [];
  return corner === "fillet" ? [ROUNDED] : ROOMS;
}

/* Find the path to declare: the first way that is accepted, {reference, offDrawn, missed}; null if there is none.
 * */
function feasible(raw, feasibility, progress = null) {
  const drawn = asDrawn(raw, feasibility);
  if (drawn !== null || smoothingOfNoise(raw, feasibility.vehicle) !== null) return drawn;
  for (const way of waysOf(feasibility)) {
    const accepted = changed(raw, feasibility, way, progress);
    if (accepted !== null) return accepted;
  }
  return null;
}

/* Take the path as it was drawn, if the robot can follow it. */
function asDrawn(raw, feasibility) {
  const drawn = reference(raw, feasibility.rod, spacingOf(raw), feasibility.drift);
  const sharpest = largestSize(drawn.curvature) * pivotRadius(feasibility.vehicle);
  if (sharpest <= AS_DRAWN && !feasibility.timeWeight) return acceptedReference(raw, drawn, feasibility);
  if (feasibility.corner !== "error") return null;
  refuseCorner(raw, feasibility.robot);
  return acceptedReference(raw, drawn, feasibility);
}

/* Change a path in one way so that the robot can follow it; null if that fails, or loses the shape. */
function changed(raw, feasibility, way, progress = null) {
  const { rod, drift, corner, timeWeight } = feasibility, radius = pivotRadius(feasibility.vehicle) / way;
  let path;
  if (way === ROUNDED) path = rounded(raw, feasibility);
  else if (pathLength(raw) < FEWEST_POSES * poseSpacing(raw, radius)) return null;
  else {
    path = nearestPath(raw, Math.max(rod, 0), radius, {
      drift, minimax: corner === "minimax", timeWeight, progress: (share) => tell(progress, DECLARING, share),
    });
  }
  return acceptedReference(raw, reference(path, rod, spacingOf(path), drift), feasibility);
}

/* Accept a reference that turns wide enough and keeps the shape of the drawn path. */
function acceptedReference(raw, followed, { vehicle }) {
  if (largestSize(followed.curvature) > TIGHTEST / pivotRadius(vehicle)) return null;
  const [offDrawn, missed] = twoSided(followed.p, polyline(raw));
  const lost = Math.min(LOST * Math.max(...extent(raw)), turnRadius(vehicle));
  return Math.max(offDrawn, missed) > lost ? null : { reference: followed, offDrawn, missed };
}

/* The length over which a noisy path is to be smoothed; null: it is not noisy. */
function smoothingOfNoise(raw, vehicle) {
  const length = Number(general(turnRadius(vehicle) / 2, 2)), whole = pathLength(raw);
  if (!(length < whole / 2)) return null;
  const { path, moved } = smoothed(raw, length);
  return whole >= NOISY * pathLength(path) && moved <= SMALL * Math.max(...extent(raw)) ? length : null;
}

/* Estimate the work of `changed`, in poses of the nearest path. cost */
function costOf(raw, { vehicle, corner }, way) {
  const whole = pathLength(raw), points = whole / spacingOf(raw) / POINTS_A_POSE;
  if (way === ROUNDED) return 14 * points;
  const poses = whole / poseSpacing(raw, pivotRadius(vehicle) / way);
  return points + poses * (corner === "minimax" ? MINIMAX : 1);
}

/* Choose the spacing of the reference's points. */
function spacingOf(path) {
  return Math.max(SPACING, pathLength(path) / MOST_POINTS);
}

/* Refuse a path with a sharp corner, and name the corner. */
function refuseCorner(raw, robot) {
  const angle = kinks(raw).map(Math.abs), sharpest = placeOfLargest(angle);
  if (angle[sharpest] > CORNER) {
    const place = placeInLab(...raw.points[sharpest], robot);
    throw new InputError(
      `corner of ${fixed(angle[sharpest] * (180 / Math.PI), 0)} degrees at ${place}; round it, or allow ` +
        "corner = nearest",
    );
  }
}

/* The place of the largest value above 0; of values that only rounding tells apart, the first one. */
function placeOfLargest(values) {
  const least = largest(values) * (1 - ROUNDING);
  return values.findIndex((value) => value >= least);
}

/* Round corners by the smallest radius that leaves the pivot some room. */
function rounded(raw, { vehicle, rod, drift }) {
  const limit = FILLET_ROOM / pivotRadius(vehicle);
  const tightest = (radius) => {
    const path = fillet(raw, radius);
    return largestSize(reference(path, rod, spacingOf(path), drift).curvature);
  };
  let low = 0, high = Math.min(largestFillet(raw), Math.sqrt(rod ** 2 + (1 / limit) ** 2));
  if (tightest(high) > limit) return fillet(raw, high);
  for (let n = 0; n < 12; n++) {
    const middle = (low + high) / 2;
    if (tightest(middle) <= limit) high = middle;
    else low = middle;
  }
  return fillet(raw, high);
}

export { TIGHTEST, LOST, waysOf, feasible, asDrawn, changed, smoothingOfNoise, costOf, spacingOf, placeOfLargest };
