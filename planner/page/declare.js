/* Paths that a robot can follow, near a path that it cannot follow as it was drawn; and what helps one that is too
 * tight: smoothing or a scale, tried before it is recommended.
 *
 * Feasibility is {robot, vehicle, rod, drift, corner, timeWeight}: rod from the pivot to the tracked point, drift
 * what carries the robot off its heading. Lengths in l. */
import { CONSTANTS } from "./constants.js";
import { largest, largestSize } from "./math.js";
import { nearestPath, poseSpacing } from "./nearest_path.js";
import { CORNER, extent, fillet, kinks, largestFillet, pathLength, polyline, scaled, smoothed } from "./path.js";
import { closest, reference, twoSided } from "./reference.js";
import { inLab, placeInLab } from "./units.js";
import { pivotRadius, turnRadius } from "./vehicle.js";
import { DECLARING, REMEDY, InputError, fixed, general, quoted } from "./words.js";

const { AS_DRAWN, ROOMS, TIGHTEST, LOST, ROUNDED, SMALL, NOISY, FEWEST_POSES, FILLET_ROOM } = CONSTANTS.declare;
const { SPACING, MOST_POINTS, MINIMAX, ROUNDING, POINTS_A_POSE } = CONSTANTS.declare;
const { LONGEST } = CONSTANTS.paths_units, { WARN, FAR } = CONSTANTS.declare;
const { SCALES, MOST_WORK, SMOOTHINGS, FIRST } = CONSTANTS.declare, { BACK } = CONSTANTS.tractrix;
const CORNERS = ["nearest", "minimax", "fillet", "error"];

/* Ways to change a path, in order of preference: ROUNDED, or shares of ROOMS. */
function waysOf({ corner }) {
  if (corner === "error") return [];
  return corner === "fillet" ? [ROUNDED] : ROOMS;
}

/* Find the path to declare: the first way that is accepted, {reference, offDrawn, missed}; null if there is none. */
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
  const sharpest = largest(sharpness(drawn)) * pivotRadius(feasibility.vehicle);
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
      drift, minimax: corner === "minimax", timeWeight, apart: closest(rod, spacingOf(raw)),
      progress: (share) => progress?.(DECLARING, share),
    });
  }
  return acceptedReference(raw, reference(path, rod, spacingOf(path), drift), feasibility);
}

/* Size of the curvature, infinite where the pivot goes back, as a rod longer than its circle does. */
function sharpness({ q, heading, curvature }) {
  return curvature.map((turn, i) => {
    const angle = (heading[i + 1] + heading[i]) / 2, [x, y] = q[i], [nextX, nextY] = q[i + 1];
    const ahead = (nextX - x) * Math.cos(angle) + (nextY - y) * Math.sin(angle);
    return ahead < -BACK ? Infinity : Math.abs(turn);
  });
}

/* Accept a reference that turns wide enough and keeps the shape of the drawn path. */
function acceptedReference(raw, followed, { vehicle, corner }) {
  const [x, y] = followed.p[0], still = followed.p.every((point) => point[0] === x && point[1] === y);
  if (still || largest(sharpness(followed)) > TIGHTEST / pivotRadius(vehicle)) return null;
  const [offDrawn, missed] = twoSided(followed.p, polyline(raw));
  const far = LOST * Math.max(...extent(raw)); // arcs leave out the tip of a sharp corner, however large the path
  const lost = corner === "fillet" ? far : Math.min(far, turnRadius(vehicle));
  return Math.max(offDrawn, missed) > lost ? null : { reference: followed, offDrawn, missed };
}

/* The length over which a noisy path is to be smoothed; null: it is not noisy. */
function smoothingOfNoise(raw, vehicle) {
  const length = Number(general(turnRadius(vehicle) / 2, 2)), whole = pathLength(raw);
  if (!(length < whole / 2)) return null;
  const { path, moved } = smoothed(raw, length);
  return whole >= NOISY * pathLength(path) && moved <= SMALL * Math.max(...extent(raw)) ? length : null;
}

/* Estimate the work of `changed`, in poses of the nearest path. */
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
      `corner of ${fixed((180 / Math.PI) * angle[sharpest], 0)} degrees at ${place}; round it, or allow ` +
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
  const roundedBy = (radius) => fillet(raw, radius, closest(rod, spacingOf(raw)));
  const tightest = (radius) => {
    const path = roundedBy(radius);
    return largestSize(reference(path, rod, spacingOf(path), drift).curvature);
  };
  let low = 0, high = Math.min(largestFillet(raw), Math.sqrt(rod ** 2 + (1 / limit) ** 2));
  if (tightest(high) > limit) return roundedBy(high);
  for (let n = 0; n < 12; n++) {
    const middle = (low + high) / 2;
    if (tightest(middle) <= limit) high = middle;
    else low = middle;
  }
  return roundedBy(high);
}

/* Choose the path that the robot will follow: {reference, curvature, offDrawn, missed, warnings}.
 *
 * curvature: largest of the pivot's reference. offDrawn: largest distance of a declared point from the drawn path;
 * missed: of a drawn point from the declared path. */
function declare(raw, feasibility, progress = null) {
  const { corner, timeWeight, robot } = feasibility;
  if (!CORNERS.includes(corner)) {
    throw new InputError(`corner ${quoted(corner)}; allowed are ${CORNERS.join(", ")}`, "options");
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
  const curvature = sharpness(drawn), worst = placeOfLargest(curvature);
  const within = inLab(pivotRadius(vehicle) / TIGHTEST, robot), circle = inLab(turnRadius(vehicle), robot);
  return `path too tight at ${placeInLab(...drawn.p[worst], robot)}: the pivot would turn with radius `
    + `${inLab(1 / curvature[worst], robot)}, the robot can with ${within}; its circle has radius ${circle}, and `
    + `the nearest path that it can follow has lost the shape; ${remedy(raw, feasibility, progress)}`;
}

/* Say what helps a path that is too tight. */
function remedy(raw, feasibility, progress = null) {
  const search = new Search(feasibility, progress), { robot } = feasibility;
  const noise = smoothingOfNoise(raw, feasibility.vehicle);
  if (noise !== null) {
    const smooth = search.smoothing(raw, noise);
    if (smooth === null) {
      return "it looks noisy, and no smoothing was found that keeps its shape: draw it with less noise";
    }
    return `it looks noisy: smoothed over ${inLab(smooth.length, robot)} it is `
      + `${inLab(pathLength(smooth.path), robot)} long, not ${inLab(pathLength(raw), robot)}, and moves by up to `
      + `${inLab(smooth.moved, robot)}; give --smooth ${general(smooth.length)}l`;
  }
  const scale = search.scale(raw);
  if (scale !== null) return `scale the path by ${general(scale, 3)}`;
  const smooth = search.smoothing(raw, FIRST * turnRadius(feasibility.vehicle));
  if (smooth === null) return "draw it with wider turns: neither a larger scale nor smoothing was found to help";
  return `smooth it over ${inLab(smooth.length, robot)}, which moves it by up to ${inLab(smooth.moved, robot)}: give `
    + `--smooth ${general(smooth.length)}l`;
}

/* A search whose work is bounded. */
class Search {
  constructor(feasibility, progress) {
    this.feasibility = feasibility;
    this.work = 0;
    this.tell = () => progress?.(REMEDY, this.work / MOST_WORK);
    // the path as drawn (null), and every other way to change it, the cheapest first
    this.ways = [null, ...waysOf(feasibility).toReversed().filter((_, i) => i % 2 === 0)];
  }

  /* Try one way; false where no work is left for it, too. */
  works(path, way) {
    if (way === null) return asDrawn(path, this.feasibility) !== null;
    const work = costOf(path, this.feasibility, way);
    if (smoothingOfNoise(path, this.feasibility.vehicle) !== null || this.work + work > MOST_WORK) return false;
    this.work += work;
    this.tell();
    return changed(path, this.feasibility, way, this.tell) !== null;
  }

  /* Find a small one of SCALES at which the path is accepted, by bisection; null if there is none. */
  scale(raw) {
    const whole = pathLength(raw), scales = SCALES.filter((scale) => whole * scale < LONGEST);
    let best = scales.length;
    for (const way of this.ways) {
      let low = 0, high = best;
      while (low < high) {
        const middle = Math.floor((low + high) / 2);
        if (this.works(scaled(raw, scales[middle]), way)) best = high = middle;
        else low = middle + 1;
      }
    }
    return best < scales.length ? scales[best] : null;
  }

  /* Find a length over which the path, smoothed, is accepted: {length, path, moved}; null if there is none. first: length
   * to begin with. */
  smoothing(raw, first) {
    for (const share of SMOOTHINGS) {
      const length = Number(general(first * share, 2));
      if (!(length < pathLength(raw) / 2)) return null;
      const { path, moved } = smoothed(raw, length);
      if (moved > LOST * Math.max(...extent(raw))) return null;
      if (this.ways.some((way) => this.works(path, way))) return { length, path, moved };
    }
    return null;
  }
}

export { declare };
