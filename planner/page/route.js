/* The shortest way of the pivot from a pose to a pose, around what it must keep out of, as in planner/goal/route.py: the
 * shortest word, or else a way over a lattice of poses that direct joints then shorten.
 *
 * Limits are {radius, body, space, drift}: least radius of the turns, the robot's discs with the pivot as origin, and what
 * carries the robot off its heading. A lattice's pose is known by its index (ix ny + iy) courses + k. Lengths in l. */
import { CONSTANTS } from "./constants.js";
import { ROUNDING, cut, poseAlong, shortestTrack, wordsBetween } from "./dubins.js";
import { TAU, bounds, halfTurn, runningSum, sum } from "./math.js";
import { ANYWHERE, BlockedError, clearance, reachOf, roomIn } from "./obstacles.js";
import { slipOf } from "./reference.js";
import { inLab, placeInLab } from "./units.js";
import { fixed } from "./words.js";

const { RANGE, DETOUR, LINK, LONGEST_LINK, STEP, CELLS, MOST_POSES, LEVELS, ROUNDS, PLACES } = CONSTANTS.route;
const { ENOUGH, AROUND, GRAIN } = CONSTANTS.route;
const AHEAD = 0.99; // of the distance from the goal: the way is longer than that by a grain or more

/* The distance of the body at a pose of the pivot from what is not free. */
function clearanceAt([x, y, course], { body, drift }, room) {
  return clearance([x, y, course - slipOf(course, drift)], body, room);
}

/* Tell whether the body keeps a margin all along a track; slack: of the room. Where there is more, steps are left out in
 * which no point of the body gets there. */
function isFree(track, limits, margin, room, slack = 0) {
  const moves = STEP * (1 + reachOf(limits.body) / limits.radius);
  for (let k = Math.ceil(track.length / STEP); k >= 0;) {
    const more = clearanceAt(poseAlong(track, k * STEP), limits, room) - margin;
    if (more < 0) return false;
    k -= Math.max(1, Math.floor((more - 2 * slack) / moves));
  }
  return true;
}

class Lattice {
  /* Poses at equal distances in the box {low, high}. */
  constructor(limits, { low, high }, spacing, courses) {
    const { body, radius, space } = limits, [width, height] = [0, 1].map((axis) => high[axis] - low[axis]);
    this.spacing = Math.max(spacing, Math.sqrt((width * height * courses) / MOST_POSES));
    [this.nx, this.ny] = [width, height].map((size) => Math.floor(size / this.spacing) + 1);
    Object.assign(this, { limits, low, courses, step: this.spacing / CELLS, count: this.nx * this.ny * courses });
    const pad = Math.ceil(reachOf(body) / this.spacing) + RANGE + 3, [left, bottom] = low.map((end) => end - pad * this.spacing);
    const [columns, rows] = [width, height].map((size) => Math.ceil(size / this.step - 1e-9) + 2 * pad * CELLS + 1);
    const known = new Float32Array(columns * rows).fill(NaN), room = roomIn(space), slack = (this.slack = this.step / Math.SQRT2);
    this.room = (x, y) => { // bounded from below, by that of the nearest point of a map
      const i = Math.round((x - left) / this.step), j = Math.round((y - bottom) / this.step), at = i * rows + j;
      if (!(i >= 0 && i < columns && j >= 0 && j < rows)) return -Infinity;
      if (Number.isNaN(known[at])) known[at] = room(left + i * this.step, bottom + j * this.step);
      return known[at] - slack;
    };
    this.joints = Array.from({ length: courses }, (_, k) => this.jointsFrom(k, radius));
  }

  courseOf(k) {
    return (TAU * k) / this.courses;
  }

  pose(index) {
    const k = index % this.courses, cell = (index - k) / this.courses, iy = cell % this.ny, ix = (cell - iy) / this.ny;
    return [this.low[0] + ix * this.spacing, this.low[1] + iy * this.spacing, this.courseOf(k)];
  }

  /* The joints from a place with a course to poses nearby. */
  jointsFrom(course, radius) {
    const joints = [], start = [0, 0, this.courseOf(course)];
    for (let i = -RANGE; i <= RANGE; i++) {
      for (let j = -RANGE; j <= RANGE; j++) {
        for (let k = 0; k < this.courses; k++) {
          const goal = [i * this.spacing, j * this.spacing, this.courseOf(k)], turn = Math.abs(halfTurn(goal[2] - start[2]));
          const { length } = shortestTrack(start, goal, radius);
          if (length > 0 && length <= DETOUR * Math.max(Math.hypot(goal[0], goal[1]), radius * turn)) {
            joints.push({ i, j, ahead: (i * this.ny + j) * this.courses + k, length: counted(length) });
          }
        }
      }
    }
    return joints;
  }

  /* The poses that a pose can be joined to, or that can be joined to it, and the lengths. */
  links(pose, onward) {
    const { radius } = this.limits, reach = Math.max(LINK * radius, 2 * this.spacing), links = new Map();
    for (let index = 0; index < this.count; index++) {
      const other = this.pose(index);
      if (Math.hypot(other[0] - pose[0], other[1] - pose[1]) > reach) index += this.courses - 1;
      else {
        const { length } = onward ? shortestTrack(pose, other, radius) : shortestTrack(other, pose, radius);
        if (length <= LONGEST_LINK * radius + this.spacing) links.set(index, counted(length));
      }
    }
    return links;
  }

  /* Find the shortest way whose body keeps a margin, by A*: tracks, or null. Lengths are counted in grains, so that those
   * of ways that are equally long are equal; of these the one with the lowest indices, from the goal back, is taken. */
  way(start, goal, margin) {
    const { limits, courses } = this, first = this.count, last = first + 1, ends = this.links(goal, false);
    const cost = new Float64Array(last + 1).fill(Infinity), before = new Int32Array(last + 1), queue = [];
    const poseOf = (index) => (index === first ? start : index === last ? goal : this.pose(index));
    const leastBy = (index) => {
      const [x, y] = poseOf(index);
      return cost[index] + Math.floor((AHEAD * Math.hypot(goal[0] - x, goal[1] - y)) / GRAIN);
    };
    const track = (from, to) => shortestTrack(poseOf(from), poseOf(to), limits.radius);
    const offer = (from, to, length) => {
      const total = cost[from] + length;
      if (total > cost[to] || (total === cost[to] && from > before[to])) return;
      if (!isFree(track(from, to), limits, margin, this.room, this.slack)) return;
      before[to] = from;
      if (total === cost[to]) return;
      cost[to] = total;
      (queue[leastBy(to)] ??= []).push(to);
    };
    cost[first] = 0;
    for (const [to, length] of this.links(start, true)) offer(first, to, length);
    for (let least = 0; least < queue.length && cost[last] >= least; least++) {
      for (const at of queue[least] ?? []) {
        if (at === last || leastBy(at) !== least) continue;
        const k = at % courses, cell = (at - k) / courses, iy = cell % this.ny, ix = (cell - iy) / this.ny;
        for (const { i, j, ahead, length } of this.joints[k]) {
          const inside = ix + i >= 0 && ix + i < this.nx && iy + j >= 0 && iy + j < this.ny;
          if (inside) offer(at, at - k + ahead, length);
        }
        if (ends.has(at)) offer(at, last, ends.get(at));
      }
    }
    if (cost[last] === Infinity) return null;
    const tracks = [];
    for (let at = last; at !== first; at = before[at]) tracks.unshift(track(before[at], at));
    return tracks;
  }

  /* Shorten a way by joints between places on it, where one is free and shorter than that part of the way. */
  shortened(tracks, margin) {
    const { limits } = this, { radius } = limits;
    let leg = tracks;
    for (let round = 1; round <= ROUNDS; round++) {
      const parts = cut(leg, Math.max(lengthOf(leg) / PLACES, radius / 4) / round), end = parts[parts.length - 1];
      const poses = [...parts.map(({ start }) => start), poseAlong(end, end.length)];
      const along = runningSum(parts.map(({ length }) => length)), best = [0], came = [null];
      for (let k = 1; k < poses.length; k++) {
        best[k] = best[k - 1] + parts[k - 1].length;
        came[k] = { from: k - 1, track: parts[k - 1] };
        for (let i = 0; i < k - 1; i++) {
          const track = shortestTrack(poses[i], poses[k], radius), total = best[i] + track.length;
          if (track.length < along[k] - along[i] - 1e-6 && total < best[k] - ROUNDING
            && isFree(track, limits, margin, this.room, this.slack)) {
            best[k] = total;
            came[k] = { from: i, track };
          }
        }
      }
      leg = [];
      for (let k = poses.length - 1; k > 0; k = came[k].from) leg.unshift(came[k].track);
    }
    return leg;
  }
}

/* A length in whole grains. */
function counted(length) {
  return Math.round(length / GRAIN);
}

function lengthOf(tracks) {
  return sum(tracks.map(({ length }) => length));
}

/* Find a short way from a pose to a pose: tracks that follow each other. lattices: those of these limits, kept. */
function route(start, goal, limits, margin, lattices, robot) {
  const { radius, space } = limits, room = roomIn(space);
  checkEnd(start, "start", limits, margin, robot);
  checkEnd(goal, "goal", limits, margin, robot);
  const words = wordsBetween(start, goal, radius).filter(({ length }) => length < Infinity);
  words.sort((one, other) => (Math.abs(one.length - other.length) < ROUNDING ? 0 : one.length - other.length));
  const direct = words.find((word) => space === ANYWHERE || isFree(word, limits, margin, room)) ?? null;
  if (direct && (space === ANYWHERE || direct.length < ENOUGH * words[0].length)) return [direct];
  for (const [spacing, courses] of LEVELS) {
    if (!lattices.has(courses)) {
      lattices.set(courses, new Lattice(limits, boxAround([start, goal], limits), spacing * radius, courses));
    }
    const lattice = lattices.get(courses), way = lattice.way(start, goal, margin);
    const around = way && lattice.shortened(way, margin);
    if (around && !(direct && direct.length <= lengthOf(around))) return around;
    if (direct) return [direct];
  }
  const [spacing, courses] = LEVELS[LEVELS.length - 1], [kept, turn, step] = [margin, radius, spacing * radius]
    .map((length) => inLab(length, robot));
  throw new BlockedError(
    `there is no way to the goal that leaves ${kept} around the robot and turns with a radius of ${turn}, on a lattice with `
    + `steps of ${step} and ${fixed(360 / courses, 0)} degrees; move the goal or the obstacles`,
  );
}

/* Refuse a start or a goal where the body does not keep the margin. */
function checkEnd(pose, name, limits, margin, robot) {
  const room = clearanceAt(pose, limits, roomIn(limits.space)), apart = inLab(Math.abs(room), robot);
  if (room >= margin) return;
  const near = room < 0 ? `${apart} inside` : `only ${apart} away from`;
  throw new BlockedError(
    `there is no way: at the ${name}, with its pivot at ${placeInLab(pose[0], pose[1], robot)}, the robot is ${near} what it `
    + `must keep out of; it needs ${inLab(margin, robot)}, which is the plan's stated error`,
  );
}

/* The box of a lattice: around all obstacles, or that of the walls. */
function boxAround(ends, { radius, body, space: { keepOut, walls } }) {
  const reach = AROUND * radius + reachOf(body), box = bounds(walls ? walls.corners : [...ends, ...keepOut.flatMap(
    ({ x, y, radius: r, corners }) => corners ?? [[x - r, y - r], [x + r, y + r]],
  )]);
  const more = walls ? 0 : reach;
  return { low: box.map(([low]) => low - more), high: box.map(([, high]) => high + more) };
}

export { route, lengthOf };
