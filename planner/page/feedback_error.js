/* The stated error with feedback, with the camera that is stated by default.
 *
 * Mirrors planner/planning/feedback_error.py, which explains it. Lengths in l, times in μ0 l⁴/EI. */
import { sum } from "./arrays.js";

const WITHIN = [1.96, 1.645]; // standard deviations on both sides that hold 95 % of a normal, a uniform variable
const KEPT = 12; // dwells that the tracker remembers for late poses
const ZIGZAG = 0.4;
const PLACE = 5;
const COURSE = 0.085; // rad
const STRETCH = 0.3; // l
const CAMERA = { noise: [0.01, 0.01], every_s: 1, delay_s: 2, lost: 0.2 };

/* Compute it from distances of the predicted track, dwells, net speed, the unit of time in seconds, and the error
 * of the open loop. feedback_error */
function feedbackError(distance, dwells, netSpeed, timeScale, stated) {
  const delay = CAMERA.delay_s / timeScale, gap = CAMERA.every_s / (timeScale * (1 - CAMERA.lost));
  if (delay * dwells.length > KEPT * sum(dwells)) return stated;
  const zigzag = inTime(distance, dwells), poses = STRETCH / (netSpeed * gap);
  const place = (PLACE * CAMERA.noise[0]) / Math.sqrt(poses + 4), course = COURSE * netSpeed * (delay + gap);
  const spread = Math.sqrt((ZIGZAG * zigzag) ** 2 + place ** 2 + course ** 2);
  return bound(zigzag / 0.95, spread);
}

/* Bound in 95 % of all cases what is uniform between ±most, with a normal error of deviation `spread`. bound */
function bound(most, spread) {
  const uniform = (most * most) / 3, variance = uniform + spread * spread;
  const share = (uniform / Math.max(variance, 1e-30)) ** 3;
  return (WITHIN[0] + share * (WITHIN[1] - WITHIN[0])) * Math.sqrt(variance);
}

/* The distance within which a track is in 95 % of the time. _in_time */
function inTime(distance, dwells) {
  const samples = (distance.length - 1) / dwells.length;
  const order = Array.from({ length: distance.length - 1 }, (_, i) => i);
  order.sort((one, other) => distance[one + 1] - distance[other + 1]);
  const least = 0.95 * sum(dwells);
  let spent = 0, at = 0;
  for (; at < order.length - 1; at++) {
    spent += dwells[Math.floor(order[at] / samples)] / samples;
    if (spent >= least) break;
  }
  return distance[order[at] + 1];
}

export { CAMERA, feedbackError };
