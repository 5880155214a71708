/* Straight motion: the motor flips so that each pair of dwells turns the robot as far to the left as to the right.
 *
 * Mirrors planner/vehicle/zigzag.py. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { column, hypot, largestSize, mean } from "./arrays.js";
import { posesAtFlips, trace } from "./rollout.js";
import { pivotDistance } from "./vehicle.js";

const PAIRS = 8; // simulated with the vehicle; the last one is taken
const TRIES = 6;

/* The zigzag of a vehicle with shortest dwell `dwell`, without the current: {dwells, speed, swing, sway, drift,
 * rms, largest}; dwells in the positive and in the negative direction, speeds net. */
function zigzag(vehicle, dwell, offset = 0) {
  const still = { ...vehicle, current: [0, 0] }, rates = vehicle.twist.map((twist) => Math.abs(twist[2]));
  const fast = rates[0] >= rates[1] ? 0 : 1, pair = [0, 0];
  let ratio = Math.abs(vehicle.twist[fast][2] / vehicle.twist[1 - fast][2]), switches, last;
  for (let count = 0; count < TRIES; count++) {
    pair[fast] = dwell;
    pair[1 - fast] = dwell * ratio;
    const dwells = Array.from({ length: 2 * PAIRS }, (_, i) => pair[i % 2]);
    switches = { firstDirection: 1, dwells, poses: [[0, 0, 0]] };
    last = posesAtFlips(still, switches).slice(-3);
    const turn = last[2][2] - last[0][2];
    if (Math.abs(turn) < 1e-10) break;
    const sign = fast === 1 ? 1 : -1; // the slower direction turns to this side
    ratio = Math.max(ratio - (sign * turn) / (Math.abs(vehicle.twist[1 - fast][2]) * dwell), 1e-3);
  }
  const middle = (last[2][2] + last[1][2]) / 2, c = Math.cos(middle), s = Math.sin(middle);
  const x = last[2][0] - last[0][0], y = last[2][1] - last[0][1], duration = pair[0] + pair[1];
  const length = Math.max(Math.sqrt(x ** 2 + y ** 2), 1e-300);
  const across = distancesAcross(trace(still, switches, offset).slice(-17, -1), [-y / length, x / length]);
  const average = mean(across);
  return {
    dwells: pair,
    speed: (c * x + s * y) / duration,
    swing: Math.abs(last[2][2] - last[1][2]),
    sway: swayOf(vehicle, last, [x / length, y / length]),
    drift: (c * y - s * x) / duration,
    rms: Math.sqrt(mean(across.map((value) => (value - average) ** 2))),
    largest: largestSize(across),
  };
}

/* Distances of a track from its middle, along a direction. */
function distancesAcross(track, [aside, ahead]) {
  const middleX = mean(column(track, 0)), middleY = mean(column(track, 1));
  return track.map(([x, y]) => (x - middleX) * aside + (y - middleY) * ahead);
}

/* Half of the distance between the pivot at flips to the right and at flips to the left. */
function swayOf(vehicle, poses, [alongX, alongY]) {
  const distance = pivotDistance(vehicle);
  const across = poses.map(([x, y, heading]) => {
    return (x - distance * Math.cos(heading)) * -alongY + (y - distance * Math.sin(heading)) * alongX;
  });
  return (across[1] - (across[0] + across[2]) / 2) / 2;
}

/* 2 h, the swing of the heading past the line of sight, with look-ahead `ahead`. Zigzag.hysteresis */
function zigzagHysteresis({ swing, sway }, ahead) {
  return Math.max(swing + 2 * Math.atan(sway / ahead), 0.2 * swing);
}

/* Speed of the straight motion, with its drift. Zigzag.net_speed */
function zigzagSpeed({ speed, drift }) {
  return hypot(speed, drift);
}

export { zigzag, zigzagHysteresis, zigzagSpeed };
