/* Regions that the robot's body must keep out of, walls that it must stay within, and its clearance from them.
 *
 * A region is {x, y, radius} or {corners}; a space is {keepOut: regions, walls: a region with corners, or null}. The
 * body is a row of discs {places, radius}, with places forward along its axis. Lengths in l. */
import { CONSTANTS } from "./constants.js";
import { clip, largestSize, smallest } from "./math.js";
import { pathLength, pathOf } from "./path.js";
import { outlineOf } from "./robot.js";
import { inLab, placeInLab } from "./units.js";
import { pivotDistance } from "./vehicle.js";
import { InputError, quoted, refusing } from "./words.js";

const { MORE } = CONSTANTS.solve;
const ANYWHERE = { keepOut: [], walls: null };
const AROUND = "the page finds no way around, as softflagella plan does: move the path or the region";

/* There is no way around what stands on a path, or to a goal. */
class BlockedError extends InputError {}

/* Read what a page's options say of regions, in cm, with the length of `cm` tails. */
function readSpace({ keepOut, walls }, cm) {
  if (!`${keepOut}${walls}`.trim()) return ANYWHERE;
  return refusing(() => {
    const [outline = null, more] = regionsOf(walls, cm);
    if (more || (outline && !outline.corners)) throw new InputError("the walls are one box or polygon");
    return { keepOut: regionsOf(keepOut, cm), walls: outline };
  }, (refusal) => {
    throw new InputError(refusal.message, "regions");
  });
}

function regionsOf(words, cm) {
  return words.split(/\s+/).filter(Boolean).map((word) => {
    const [shape, numbers = ""] = word.split(":"), values = numbers.split(",").map((text) => (text ? text / cm : NaN));
    const [a, b, c, d] = values, count = values.length, known = values.every(Number.isFinite);
    if (known && shape === "circle" && count === 3 && c > 0) return { x: a, y: b, radius: c };
    if (known && shape === "box" && count === 4) return polygonOf([[a, b], [c, b], [c, d], [a, d]], word);
    if (known && shape === "polygon" && count > 5 && count % 2 === 0) {
      return polygonOf(values.flatMap((x, i) => (i % 2 ? [] : [[x, values[i + 1]]])), word);
    }
    throw new InputError(
      `region ${quoted(word)}; write circle:X,Y,RADIUS, box:LEFT,LOW,RIGHT,HIGH or polygon:X,Y,X,Y,X,Y with numbers in cm`,
    );
  });
}

/* Make a region of points; refuse an outline that encloses nothing, crosses or touches itself. */
function polygonOf(points, word) {
  const outline = pathOf(points, true), { points: corners } = outline, last = corners.length - 1;
  const side = ([x, y], [toX, toY], [atX, atY]) => (toX - x) * (atY - y) - (toY - y) * (atX - x);
  const area = corners.reduce((total, corner, i) => total + side(corners[0], corner, corners[i < last ? i + 1 : 0]), 0);
  if (Math.abs(area) / 2 <= 1e-12 * pathLength(outline) ** 2) {
    throw new InputError(`region ${quoted(word)} needs three or more points that are not on one line`);
  }
  const edges = corners.map((corner, i) => [corner, corners[i < last ? i + 1 : 0]]);
  const overlap = (edge, other, axis) => {
    const [[low, high], [from, to]] = [edge, other].map((each) => each.map((end) => end[axis]).sort((p, q) => p - q));
    return low <= to && from <= high;
  };
  const meet = ([p, q], [r, s]) => {
    return side(p, q, r) * side(p, q, s) <= 0 && side(r, s, p) * side(r, s, q) <= 0 && overlap([p, q], [r, s], 0)
      && overlap([p, q], [r, s], 1);
  };
  if (edges.some((edge, i) => edges.some((other, j) => j > i + 1 && j - i < last && meet(edge, other)))) {
    throw new InputError(`region ${quoted(word)}: draw it so that it neither crosses, touches nor repeats itself`);
  }
  return { corners };
}

/* Cover the body with discs; origin: from the head's centre forward to the point from which places count. */
function footprint(robot, origin) {
  const [front, back, width] = outlineOf(robot), length = front - back;
  const count = Math.max(2, Math.ceil(length / width)), step = length / count;
  const places = Array.from({ length: count }, (_, i) => back + step * (i + 0.5) - origin);
  return { places, radius: Math.hypot(width, step / 2) };
}

/* Make a function of the distance of a place from what is not free, negative inside. */
function roomIn({ keepOut, walls }) {
  return (x, y) => {
    const within = walls ? -distanceFrom(walls, x, y) : Infinity;
    return keepOut.reduce((least, region) => Math.min(least, distanceFrom(region, x, y)), within);
  };
}

/* The distance of the body at a pose from what is not free. room: as that of a space. */
function clearance([x, y, heading], { places, radius }, room) {
  const c = Math.cos(heading), s = Math.sin(heading);
  return places.reduce((least, place) => Math.min(least, room(x + place * c, y + place * s)), Infinity) - radius;
}

function clearances(poses, body, space) {
  const room = roomIn(space);
  return Float64Array.from(poses, (pose) => clearance(pose, body, room));
}

/* The largest distance of a point of the body from its origin. */
function reachOf({ places, radius }) {
  return largestSize(places) + radius;
}

/* The distance of a place from a region, negative inside. */
function distanceFrom({ x: midX, y: midY, radius, corners }, x, y) {
  if (!corners) return Math.hypot(x - midX, y - midY) - radius;
  let square = Infinity, inside = false, [fromX, fromY] = corners[corners.length - 1];
  for (const [toX, toY] of corners) {
    const dx = toX - fromX, dy = toY - fromY, awayX = x - fromX, awayY = y - fromY;
    const share = clip((awayX * dx + awayY * dy) / (dx * dx + dy * dy), 0, 1);
    square = Math.min(square, (awayX - share * dx) ** 2 + (awayY - share * dy) ** 2);
    if (fromY <= y !== toY <= y && awayX < (awayY * dx) / dy) inside = !inside;
    [fromX, fromY] = [toX, toY];
  }
  return (inside ? -1 : 1) * Math.sqrt(square);
}

/* How a followed path keeps clear: {space, margin, clearance}; null: there is nothing in its way. One that is blocked is
 * refused: its way around is sought by the command. */
function keptClear({ tracked: { robot, vehicle }, declared: { reference }, rolled, stated }, space) {
  if (space === ANYWHERE) return null;
  const margin = MORE * stated, poses = reference.q.map(([x, y], i) => [x, y, reference.heading[i]]);
  const room = clearances(poses, footprint(robot, -pivotDistance(vehicle)), space), least = smallest(room);
  const clearance = smallest(clearances(rolled.motion, footprint(robot, 0), space));
  if (least >= margin && clearance > 0) return { space, margin, clearance };
  const place = placeInLab(...reference.p[room.indexOf(least)], robot), free = inLab(Math.max(least, 0), robot);
  throw new BlockedError(
    `the path is blocked at ${place}, where the robot has ${free} around it; it needs ${inLab(margin, robot)}, the stated `
    + `error; ${AROUND}`,
  );
}

/* The entry `kept_clear` of plan.json. */
function keptClearRecord({ space: { keepOut, walls }, margin, clearance }) {
  return {
    keep_out: keepOut.map(({ x, y, radius, corners }) => (corners ? { polygon: corners } : { circle: [x, y, radius] })),
    walls: walls && walls.corners, margin_over_l: margin, predicted_clearance_over_l: clearance, detours: [],
  };
}

export { ANYWHERE, BlockedError, readSpace, footprint, roomIn, clearance, clearances, reachOf, keptClear, keptClearRecord };
