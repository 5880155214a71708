/* Line-of-sight guidance: the equation for the next flip, which planner/planning/schedule.py explains.
 *
 * Mirrors planner/planning/line_of_sight.py. Guidance is {dwell, ahead, swing}; a pose is [x, y, heading] of the
 * head's centre. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { column } from "./arrays.js";
import { InputError } from "./input_error.js";
import { BEFORE_KNOTS, COUNT, STEP, pivotDistance, pivotRadius, sideOf } from "./vehicle.js";

const EXACT = 1e-7; // rad, of the heading at a flip
const LARGEST_STEP = 0.4; // rad that the robot turns between two evaluations
const TURNS = 4 * Math.PI; // a dwell that turns further than this leads nowhere
const MOST_BIAS = 0.3; // rad
const HALVINGS = 30;
const MOST_LOOKS = 500; // evaluations of the equation for one dwell; about four are needed

/* Compute h at every step of the reference. */
function hysteresis(reference, vehicle, swing) {
  const radius = pivotRadius(vehicle);
  return reference.curvature.map((curvature) => (swing * (1 + Math.min(Math.abs(curvature) * radius, 1))) / 2);
}

/* A vehicle, its reference, and the place that it has reached; offset: from the head's centre forward to the
 * tracked point. */
class LineOfSight {
  constructor(reference, vehicle, guidance, offset) {
    this.x = column(reference.q, 0);
    this.y = column(reference.q, 1);
    this.heading = Float64Array.from(reference.heading);
    this.arc = reference.arc;
    this.last = this.x.length - 2;
    this.dwell = guidance.dwell;
    this.ahead = guidance.ahead;
    this.rod = pivotDistance(vehicle) + offset;
    this.offset = offset;
    this.hysteresis = hysteresis(reference, vehicle, guidance.swing);
    this.vehicle = vehicle;
    this.place = 0;
    this.share = 0; // of the step at the place
    this.error = this.lastError = this.bias = this.reached = 0;
  }

  /* Predict the pose of the head's centre after `time` in direction `sense`. */
  poseAfter(pose, sense, before, time) {
    const side = sideOf(sense), [forward, left, rate] = this.vehicle.twist[side], { current } = this.vehicle;
    const [lagZ, lagX, turned] = this.lagAfter(side, before, time), [along, across, angle] = arcTerms(rate, time);
    const ahead = along * forward - across * left, aside = across * forward + along * left;
    let c = Math.cos(turned), s = Math.sin(turned);
    const z = lagZ + (c * ahead - s * aside), x = lagX + (s * ahead + c * aside);
    c = Math.cos(pose[2]);
    s = Math.sin(pose[2]);
    return [
      pose[0] + c * z - s * x + current[0] * time, pose[1] + s * z + c * x + current[1] * time,
      pose[2] + turned + angle,
    ];
  }

  /* Interpolate the lag after `time` in direction `side` (0: positive, 1: negative); null: from rest. */
  lagAfter(side, before, time) {
    const u = time / STEP, beyond = Math.trunc(u) > COUNT - 2;
    const i = beyond ? COUNT - 2 : Math.trunc(u), w = beyond ? 1 : u - i;
    const between = (table, at) => table[at] + w * (table[at + 3] - table[at]);
    if (before === null) return [0, 1, 2].map((k) => between(this.vehicle.rest[side], 3 * i + k));
    const { k: knot, part } = knotBelow(before), table = this.vehicle.lag[side];
    const shorter = 3 * (knot * COUNT + i), longer = shorter + 3 * COUNT;
    return [0, 1, 2].map((k) => {
      const near = between(table, shorter + k);
      return part ? near + part * (between(table, longer + k) - near) : near;
    });
  }

  /* Add the mean error of the last two dwells to the integral; errors at flips alternate. */
  integrate(pose, sense) {
    this.excess(pose, sense);
    const reached = this.arc[this.place], advance = reached - this.reached;
    this.reached = reached;
    this.bias += ((this.error + this.lastError) * advance) / (4 * this.ahead ** 2);
    this.bias = Math.min(Math.max(this.bias, -MOST_BIAS), MOST_BIAS);
    this.lastError = this.error;
  }

  /* Compute σ(φ − φ_d) − h, which is zero at a flip; move the place to the step nearest to the pivot. */
  excess(pose, sense) {
    const heading = pose[2], c = Math.cos(heading), s = Math.sin(heading), { x: xs, y: ys, last } = this;
    const x = pose[0] + this.offset * c - this.rod * c, y = pose[1] + this.offset * s - this.rod * s;
    let i = this.place, moved = 0, dx, dy, awayX, awayY, square, share;
    for (;;) {
      dx = xs[i + 1] - xs[i];
      dy = ys[i + 1] - ys[i];
      awayX = x - xs[i];
      awayY = y - ys[i];
      square = dx * dx + dy * dy;
      share = square > 0 ? (awayX * dx + awayY * dy) / square : 2;
      if (share > 1 && i < last && moved >= 0) {
        i++;
        moved = 1;
      } else if (share < 0 && i > 0 && moved <= 0) {
        i--;
        moved = -1;
      } else break;
    }
    this.place = i;
    this.share = share;
    this.error = square > 0 ? (dx * awayY - dy * awayX) / Math.sqrt(square) : 0;
    const within = Math.min(Math.max(share, 0), 1);
    let wanted = this.heading[i] + within * (this.heading[i + 1] - this.heading[i]);
    wanted -= Math.atan(this.error / this.ahead) + this.bias;
    return sense * (heading - wanted) - this.hysteresis[i];
  }

  get ended() {
    return this.place >= this.last && this.share >= 1;
  }

  /* Compute the length of the dwell that begins at `pose`, and whether the path ends in it: {time, ended}.
   *
   * The last dwell is trimmed. If it were too short for the motor, it is the shortest one or none at all,
   * whichever ends nearer to the path's end. */
  nextDwell(pose, sense, before) {
    const { time, ended } = this.nextFlip(pose, sense, before);
    if (!(ended && time < this.dwell && before !== null)) return { time, ended };
    return { time: 2 * time > this.dwell ? this.dwell : 0, ended };
  }

  /* The same without this rule. */
  nextFlip(pose, sense, before) {
    const rate = Math.abs(this.vehicle.twist[sideOf(sense)][2]);
    const longest = TURNS / rate, most = LARGEST_STEP / rate;
    const look = (at) => this.excess(this.poseAfter(pose, sense, before, at), sense);
    let time = this.dwell, value = look(time), low = 0, lowValue = null, slope = rate;
    for (let n = 0; n < MOST_LOOKS; n++) {
      if (this.ended) return { time: this.endTime(look, time), ended: true };
      if (value >= 0 && (lowValue === null || value < EXACT)) return { time, ended: false };
      if (value >= 0) return { time: root(look, [low, lowValue], [time, value]), ended: false };
      if (-value < EXACT) return { time, ended: false };
      low = time;
      lowValue = value;
      time += Math.min((-1.02 * value) / Math.max(slope, 0.1 * rate), most);
      if (time > longest) break;
      value = look(time);
      slope = (value - lowValue) / (time - low);
    }
    throw new InputError("the robot turns in circles and does not reach the path; check the path's scale");
  }

  /* Find the time at which the path ends, by bisection. */
  endTime(look, time) {
    let low = 0, high = time;
    for (let n = 0; n < HALVINGS; n++) {
      const middle = (low + high) / 2;
      look(middle);
      if (this.ended) high = middle;
      else low = middle;
    }
    return high;
  }
}

/* Find the root between a value below zero and one above, by regula falsi (Illinois). */
function root(look, [a, fa], [b, fb]) {
  let time = b;
  for (let n = 0; n < HALVINGS; n++) {
    time = a - (fa * (b - a)) / (fb - fa);
    const value = look(time);
    if (Math.abs(value) < EXACT) break;
    if (value < 0) [a, fa, fb] = [time, value, fb / 2];
    else [b, fb, fa] = [time, value, fa / 2];
  }
  return time;
}

/* Return sin Ω T/Ω, (1 − cos Ω T)/Ω and Ω T. */
function arcTerms(rate, time) {
  const angle = rate * time, half = Math.sin(angle / 2);
  return [Math.sin(angle) / rate, (2 * half * half) / rate, angle];
}

/* Find the knot below the length of the dwell before, and the share of the step to the next knot. */
function knotBelow(before) {
  const last = BEFORE_KNOTS.length - 1;
  if (before >= BEFORE_KNOTS[last]) return { k: last - 1, part: 1 };
  let k = 0;
  while (before > BEFORE_KNOTS[k + 1]) k++;
  return { k, part: Math.max((before - BEFORE_KNOTS[k]) / (BEFORE_KNOTS[k + 1] - BEFORE_KNOTS[k]), 0) };
}

export { LineOfSight, hysteresis };
