/* Shortest tracks of bounded curvature between poses: Dubins' words of three segments, as in planner/paths/dubins.py.
 *
 * A track is {start, turns, lengths, radius, length}: turns of its segments are +1 (left), 0 or −1; a length that is
 * infinite: there is no such track. Poses are [x, y, course]; lengths in l, angles in rad. */
import { TAU, arc, clip, compose, linspace, mod, runningSum, sum, unwrap } from "./math.js";
import { stepsOf } from "./path.js";
import { CONSTANTS } from "./constants.js";

const { ROUNDING } = CONSTANTS.dubins;

/* List the tracks of the six words, whether they exist or not. */
function wordsBetween(start, goal, radius) {
  const x = (goal[0] - start[0]) / radius, y = (goal[1] - start[1]) / radius, d = Math.hypot(x, y);
  const direction = Math.atan2(y, x), a = start[2] - direction, b = goal[2] - direction, cosine = Math.cos(a - b);
  const sa = Math.sin(a), sb = Math.sin(b), ca = Math.cos(a), cb = Math.cos(b);
  const track = (turns, exists, first, middle, last) => {
    const lengths = [turn(first), middle, turn(last)].map((part) => (exists ? part * radius : Infinity));
    return { start, turns, lengths, radius, length: sum(lengths) };
  };
  const alike = (side) => {
    const square = 2 + d * d - 2 * cosine + side * 2 * d * (sa - sb);
    const angle = Math.atan2(side * (cb - ca), d + side * (sa - sb)), straight = Math.sqrt(Math.max(square, 0));
    return track([side, 0, side], square >= -ROUNDING, side * (angle - a), straight, side * (b - angle));
  };
  const across = (side) => {
    const square = d * d - 2 + 2 * cosine + side * 2 * d * (sa + sb), straight = Math.sqrt(Math.max(square, 0));
    const angle = Math.atan2(-side * (ca + cb), d + side * (sa + sb)) - Math.atan2(-side * 2, straight);
    return track([side, 0, -side], square >= -ROUNDING, side * (angle - a), straight, side * (angle - b));
  };
  const arcs = (side) => {
    const turned = (6 - d * d + 2 * cosine + side * 2 * d * (sa - sb)) / 8, middle = TAU - Math.acos(clip(turned, -1, 1));
    const first = side * a - Math.atan2(ca - cb, d - side * (sa - sb)) + middle / 2;
    return track([-side, side, -side], Math.abs(turned) <= 1, first, middle, side * (a - b) - first + middle);
  };
  return [alike, across, arcs].flatMap((word) => [word(1), word(-1)]);
}

/* Reduce an angle to [0, 2π); a whole turn that comes from rounding is none. */
function turn(angle) {
  const rest = mod(angle, TAU);
  return rest > TAU - ROUNDING ? 0 : rest;
}

/* The shortest track; of those that only rounding tells apart, the first one. */
function shortestTrack(start, goal, radius) {
  return wordsBetween(start, goal, radius).reduce((best, word) => (word.length < best.length - ROUNDING ? word : best));
}

/* The pose after a way along a track; beyond the end, that of the end. */
function poseAlong({ start, turns, lengths, radius }, way) {
  let pose = start, remaining = way;
  turns.forEach((side, i) => {
    pose = compose(pose, arc([1, 0, side / radius], clip(remaining, 0, lengths[i])));
    remaining -= lengths[i];
  });
  return pose;
}

/* Sample poses of tracks that follow each other, at most `spacing` apart, courses without jumps. */
function chainOf(tracks, spacing) {
  const poses = [tracks[0].start, ...tracks.filter(({ length }) => length > 0).flatMap((track) => {
    const ways = linspace(0, track.length, Math.max(1, stepsOf(track.length, spacing)) + 1).subarray(1);
    return Array.from(ways, (way) => poseAlong(track, way));
  })];
  const courses = unwrap(poses.map(([, , course]) => course));
  return poses.map(([x, y], i) => [x, y, courses[i]]);
}

/* Cut tracks into parts of at most `spacing`. */
function cut(tracks, spacing) {
  return tracks.filter(({ length }) => length > 0).flatMap((track) => {
    const edges = linspace(0, track.length, Math.max(1, stepsOf(track.length, spacing)) + 1), ends = runningSum(track.lengths);
    return Array.from(edges.subarray(1), (edge, k) => {
      const lengths = track.lengths.map((_, i) => Math.max(Math.min(ends[i + 1], edge) - Math.max(ends[i], edges[k]), 0));
      return { ...track, start: poseAlong(track, edges[k]), lengths, length: sum(lengths) };
    });
  });
}

export { ROUNDING, wordsBetween, shortestTrack, poseAlong, chainOf, cut };
