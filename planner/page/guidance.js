/* Switching times by hysteresis about the line of sight: flip where the heading has passed it by h.
 *
 * Guidance is {dwell, ahead, swing}; a pose is [x, y, heading] of the head's centre; offset is from there forward to
 * the tracked point. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { clip, column, compose, inversePose, sum } from "./math.js";
import { motionAfter, pivotDistance, pivotRadius, sideOf, speedOf, turnRadius, zigzag } from "./vehicle.js";
import { FOLLOWING, InputError, general } from "./words.js";

const { EXACT, LARGEST_STEP, LARGEST_TURN, TURNS, MOST_BIAS, HALVINGS, MOST_LOOKS } = CONSTANTS.law;
const { MOST_SWITCHES, PATIENCE, EVERY, QUICKEST } = CONSTANTS.line_of_sight;

/* Compute h at every step of the reference. */
function hysteresis(reference, vehicle, swing) {
  const radius = pivotRadius(vehicle);
  return reference.curvature.map((curvature) => (swing * (1 + Math.min(Math.abs(curvature) * radius, 1))) / 2);
}

/* A vehicle, its reference, and the place that it has reached. */
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
    const [x, y, heading] = compose(pose, motionAfter(this.vehicle, sense, before, time)), { current } = this.vehicle;
    return [x + current[0] * time, y + current[1] * time, heading];
  }

  /* Add the mean error of the last two dwells to the integral; errors at flips alternate. */
  integrate(pose, sense) {
    this.excess(pose, sense);
    const reached = this.arc[this.place], advance = reached - this.reached;
    this.reached = reached;
    const bias = this.bias + ((this.error + this.lastError) * advance) / (4 * this.ahead ** 2);
    this.bias = clip(bias, -MOST_BIAS, MOST_BIAS);
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
      if (share > 1 && i < last && moved >= 0) moved = 1;
      else if (share < 0 && i > 0 && moved <= 0) moved = -1;
      else break;
      i += moved;
    }
    this.place = i;
    this.share = share;
    this.error = square > 0 ? (dx * awayY - dy * awayX) / Math.sqrt(square) : 0;
    let wanted = this.heading[i] + clip(share, 0, 1) * (this.heading[i + 1] - this.heading[i]);
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
    const rate = Math.abs(this.vehicle.twist[sideOf(sense)][2]), most = LARGEST_STEP / rate;
    const look = (at) => this.excess(this.poseAfter(pose, sense, before, at), sense);
    let { place } = this, longest = TURNS / rate, lowValue = null, slope = rate;
    let { time, low } = this.approach(look, rate, this.dwell), value = look(time);
    for (let n = 0; n < MOST_LOOKS; n++) {
      if (this.ended) return { time: this.endTime(look, low, time), ended: true };
      if ((value >= 0 && lowValue === null) || Math.abs(value) < EXACT) return { time, ended: false };
      if (value >= 0) return { time: root(look, [low, lowValue], [time, value]), ended: false };
      low = time;
      lowValue = value;
      time += Math.min((-1.02 * value) / Math.max(slope, 0.1 * rate), most);
      if (time > longest) {
        if (this.place <= place) break;
        ({ place } = this);
        longest += TURNS / rate; // its circles lead along the path
      }
      value = look(time);
      slope = (value - lowValue) / (time - low);
    }
    throw new InputError("the robot turns in circles and does not reach the path; check the path's scale");
  }

  /* Move the place with the robot nearly until `end`, in turns of at most LARGEST_TURN: seen from across a circle
   * another step may be nearer. Returns when to look next, at `end` or where the path has ended, and a time before. */
  approach(look, rate, end) {
    const count = Math.ceil((end * rate) / LARGEST_TURN);
    let low = 0;
    for (let n = 1; n < count; n++) {
      const time = n * (end / count);
      look(time);
      if (this.ended) return { time, low };
      low = time;
    }
    return { time: end, low };
  }

  /* Find the time at which the path ends, by bisection between a time before its end and one after it. */
  endTime(look, low, high) {
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

/* Choose dwell times that keep the tracked point on the reference: switches {firstDirection, dwells, poses}. start: at rest,
 * {pose, sense}; null: on the reference. */
function follow(reference, vehicle, guidance, offset = 0, progress = null, start = null) {
  let { pose, sense } = start ?? startAtRest(reference, vehicle, guidance, offset);
  const law = new LineOfSight(reference, vehicle, guidance, offset), firstDirection = sense, dwells = [], poses = [pose];
  const around = guidance.ahead + pivotDistance(vehicle) + offset + turnRadius(vehicle);
  const patience = (PATIENCE * around) / Math.max(speedOf(vehicle), 1e-300);
  let before = null, furthest = law.place, stalled = 0; // before: at rest
  for (;;) {
    const { time, ended } = law.nextDwell(pose, sense, before);
    if (time > 0) {
      pose = law.poseAfter(pose, sense, before, time);
      law.integrate(pose, sense);
      dwells.push(time);
      poses.push(pose);
      sense = -sense;
      before = time;
    }
    if (ended) {
      checkDuration(dwells, reference, vehicle);
      return { firstDirection, dwells: Float64Array.from(dwells), poses };
    }
    stalled = law.place > furthest ? 0 : stalled + time;
    furthest = Math.max(furthest, law.place);
    if (stalled > patience) {
      const [x, y] = reference.p[furthest].map((value) => general(value, 3));
      throw new InputError(
        `the robot does not get past (${x}, ${y}) l, where the path turns back too sharply; split it there`,
      );
    }
    if (dwells.length >= MOST_SWITCHES) {
      throw new InputError(`the path needs more than ${MOST_SWITCHES} switches; split it`);
    }
    if (dwells.length % EVERY === 0) progress?.(FOLLOWING, law.place / reference.q.length);
  }
}

/* Throw where a schedule is too short for its path: its end was accepted too early. */
function checkDuration(dwells, reference, vehicle) {
  let lag = 0;
  for (const table of vehicle.rest) {
    for (let i = 0; i < table.length; i += 3) lag = Math.max(lag, Math.hypot(table[i], table[i + 1]));
  }
  const fastest = Math.max(...vehicle.twist.map(([forward]) => Math.abs(forward))) + Math.hypot(...vehicle.current);
  const time = sum(dwells), length = reference.arc.at(-1);
  if (fastest * time < QUICKEST * (length - dwells.length * lag)) {
    throw new Error(
      `a schedule of ${general(time, 3)} time units is too short for ${general(length, 3)} l: an error of the `
      + "planner; please report robot and path",
    );
  }
}

/* The side to which the heading turns first: 1 to the left, or straight on; −1 to the right. */
function firstTurn(heading) {
  const turning = heading.find((angle) => Math.abs(angle - heading[0]) > 1e-6);
  return turning === undefined || turning > heading[0] ? 1 : -1;
}

/* Start at rest near the beginning of the reference, so that the first dwell continues as one of the zigzag does:
 * {pose, sense}. */
function startAtRest(reference, vehicle, guidance, offset) {
  const [first] = reference.heading, sense = firstTurn(reference.heading);
  const straight = zigzag(vehicle, guidance.dwell, offset);
  const heading = first - sense * straight.swing * (1 - hysteresis(reference, vehicle, 1)[0]);
  const [[px, py], [qx, qy]] = [reference.p[0], reference.q[0]], toHead = Math.hypot(px - qx, py - qy) - offset;
  const sway = sense * straight.sway, c = Math.cos(heading), s = Math.sin(heading);
  const bent = [qx + sway * s + toHead * c, qy - sway * c + toHead * s, heading];
  const before = straight.dwells[sideOf(-sense)];
  const after = compose(bent, motionAfter(vehicle, sense, before, guidance.dwell));
  return { pose: compose(after, inversePose(motionAfter(vehicle, sense, null, guidance.dwell))), sense };
}

export { follow, firstTurn };
