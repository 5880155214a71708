/* Switching times by hysteresis about the line of sight: flip where the heading has passed it by h.
 *
 * As planner/guidance/law.py, without a way to the reference. Guidance is {dwell, ahead, swing}; a state is where the robot
 * is on the reference, and what the law remembers of the last flip; a pose is [x, y, heading] of the head's centre; offset
 * is from there forward to the tracked point. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { clip, column, compose, inversePose, sum } from "./math.js";
import { motionAfter, pivotDistance, pivotRadius, sideOf, speedOf, turnRadius, zigzag } from "./vehicle.js";
import { FOLLOWING, InputError, general } from "./words.js";

const { EXACT, LARGEST_STEP, LARGEST_TURN, TURNS, MOST_BIAS, HALVINGS, MOST_LOOKS } = CONSTANTS.law;
const { MOST_SWITCHES, PATIENCE, EVERY, QUICKEST } = CONSTANTS.line_of_sight;
const AT_START = { step: 0, share: 0, error: 0, lastError: 0, bias: 0, reached: 0 };

/* Compute h at every step of the reference. */
function hysteresis(reference, vehicle, swing) {
  const radius = pivotRadius(vehicle);
  return reference.curvature.map((curvature) => (swing * (1 + Math.min(Math.abs(curvature) * radius, 1))) / 2);
}

/* What is followed, by which robot, and how. */
function lawOf(reference, vehicle, guidance, offset) {
  return {
    x: column(reference.q, 0),
    y: column(reference.q, 1),
    heading: Float64Array.from(reference.heading),
    arc: reference.arc,
    hysteresis: hysteresis(reference, vehicle, guidance.swing),
    last: reference.q.length - 2,
    dwell: guidance.dwell,
    ahead: guidance.ahead,
    rod: pivotDistance(vehicle) + offset,
    offset,
    vehicle,
  };
}

/* Predict the pose of the head's centre after `time` in direction `sense`. */
function poseAfter({ vehicle }, pose, sense, before, time) {
  const [x, y, heading] = compose(pose, motionAfter(vehicle, sense, before, time)), { current } = vehicle;
  return [x + current[0] * time, y + current[1] * time, heading];
}

/* Compute σ(φ − φ_d) − h, which is zero at a flip, and find the place nearest to the pivot: [value, state]. */
function excess(law, state, pose, sense) {
  const heading = pose[2], c = Math.cos(heading), s = Math.sin(heading), { x: xs, y: ys, last } = law;
  const x = pose[0] + law.offset * c - law.rod * c, y = pose[1] + law.offset * s - law.rod * s;
  let i = state.step, moved = 0, dx, dy, awayX, awayY, square, share;
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
  const error = square > 0 ? (dx * awayY - dy * awayX) / Math.sqrt(square) : 0;
  let wanted = law.heading[i] + clip(share, 0, 1) * (law.heading[i + 1] - law.heading[i]);
  wanted -= Math.atan(error / law.ahead) + state.bias;
  return [sense * (heading - wanted) - law.hysteresis[i], { ...state, step: i, share, error }];
}

/* Compute the same after `time` in a dwell that began at `pose`. */
function excessAfter(law, state, pose, sense, before, time) {
  return excess(law, state, poseAfter(law, pose, sense, before, time), sense);
}

/* Tell whether the path ends at a place. */
function hasEnded(law, state) {
  return state.step >= law.last && state.share >= 1;
}

/* Add the mean error of the last two dwells to the integral; errors at flips alternate. */
function integrate(law, state, pose, sense) {
  const [, there] = excess(law, state, pose, sense), reached = law.arc[there.step];
  const mean = (there.error + there.lastError) / 2, advance = reached - there.reached;
  const bias = clip(there.bias + (mean * advance) / (2 * law.ahead ** 2), -MOST_BIAS, MOST_BIAS);
  return { ...there, lastError: there.error, bias, reached };
}

/* Move the place with the robot from `pose` nearly until `time`, in turns of at most LARGEST_TURN: seen from across a
 * circle another step may be nearer. Returns when to look next, at `time` or where the path has ended; a time before; and
 * where the robot is then. */
function approach(law, state, pose, sense, before, time) {
  const rate = Math.abs(law.vehicle.twist[sideOf(sense)][2]), count = Math.ceil((time * rate) / LARGEST_TURN);
  let low = 0;
  for (let n = 1; n < count; n++) {
    const high = n * (time / count);
    [, state] = excessAfter(law, state, pose, sense, before, high);
    if (hasEnded(law, state)) return [high, low, state];
    low = high;
  }
  return [time, low, state];
}

/* Compute the length of the dwell that begins at `pose`, and whether the path ends in it: {time, ended, state}.
 *
 * The last dwell is trimmed. If it were too short for the motor, it is the shortest one or none at all, whichever ends
 * nearer to the path's end. */
function nextDwell(law, state, pose, sense, before) {
  const flip = nextFlip(law, state, pose, sense, before);
  if (!(flip.ended && flip.time < law.dwell && before !== null)) return flip;
  return { ...flip, time: 2 * flip.time > law.dwell ? law.dwell : 0 };
}

/* Find the first time at which the law asks for a flip, or the path ends. */
function nextFlip(law, state, pose, sense, before) {
  const rate = Math.abs(law.vehicle.twist[sideOf(sense)][2]), most = LARGEST_STEP / rate;
  let furthest = state.step, longest = TURNS / rate, time, low, value, lowValue = null, slope = rate;
  [time, low, state] = approach(law, state, pose, sense, before, law.dwell);
  [value, state] = excessAfter(law, state, pose, sense, before, time);
  for (let n = 0; n < MOST_LOOKS; n++) {
    if (hasEnded(law, state)) return end(law, state, pose, sense, before, low, time);
    if ((value >= 0 && lowValue === null) || Math.abs(value) < EXACT) return { time, ended: false, state };
    if (value >= 0) return root(law, state, pose, sense, before, [low, lowValue], [time, value]);
    low = time;
    lowValue = value;
    time += Math.min((-1.02 * value) / Math.max(slope, 0.1 * rate), most);
    if (time > longest) {
      if (state.step <= furthest) break;
      furthest = state.step;
      longest += TURNS / rate; // its circles lead along the path
    }
    [value, state] = excessAfter(law, state, pose, sense, before, time);
    slope = (value - lowValue) / (time - low);
  }
  throw new InputError("the robot turns in circles and does not reach the path; check the path's scale");
}

/* Find the root between a value below zero and one above, by regula falsi (Illinois). */
function root(law, state, pose, sense, before, [a, fa], [b, fb]) {
  let time = b, value;
  for (let n = 0; n < HALVINGS; n++) {
    time = a - (fa * (b - a)) / (fb - fa);
    [value, state] = excessAfter(law, state, pose, sense, before, time);
    if (Math.abs(value) < EXACT) break;
    if (value < 0) [a, fa, fb] = [time, value, fb / 2];
    else [b, fb, fa] = [time, value, fa / 2];
  }
  return { time, ended: false, state };
}

/* Find the time at which the path ends, by bisection between a time before its end and one after it. */
function end(law, state, pose, sense, before, low, high) {
  for (let n = 0; n < HALVINGS; n++) {
    const middle = (low + high) / 2;
    [, state] = excessAfter(law, state, pose, sense, before, middle);
    if (hasEnded(law, state)) high = middle;
    else low = middle;
  }
  return { time: high, ended: true, state };
}

/* Choose dwell times that keep the tracked point on the reference: switches {firstDirection, dwells, poses}. start: at rest,
 * {pose, sense}; null: on the reference. */
function follow(reference, vehicle, guidance, offset = 0, progress = null, start = null) {
  let { pose, sense } = start ?? startAtRest(reference, vehicle, guidance, offset);
  const law = lawOf(reference, vehicle, guidance, offset), firstDirection = sense, dwells = [], poses = [pose];
  const around = guidance.ahead + pivotDistance(vehicle) + offset + turnRadius(vehicle);
  const patience = (PATIENCE * around) / Math.max(speedOf(vehicle), 1e-300);
  let state = AT_START, before = null, furthest = 0, stalled = 0; // before: at rest
  for (;;) {
    const { time, ended, state: there } = nextDwell(law, state, pose, sense, before);
    state = there;
    if (time > 0) {
      pose = poseAfter(law, pose, sense, before, time);
      state = integrate(law, state, pose, sense);
      dwells.push(time);
      poses.push(pose);
      sense = -sense;
      before = time;
    }
    if (ended) {
      checkDuration(dwells, reference, vehicle);
      return { firstDirection, dwells: Float64Array.from(dwells), poses };
    }
    stalled = state.step > furthest ? 0 : stalled + time;
    furthest = Math.max(furthest, state.step);
    if (stalled > patience) {
      const [x, y] = reference.p[furthest].map((value) => general(value, 3));
      throw new InputError(
        `the robot does not get past (${x}, ${y}) l, where the path turns back too sharply; split it there`,
      );
    }
    if (dwells.length >= MOST_SWITCHES) {
      throw new InputError(`the path needs more than ${MOST_SWITCHES} switches; split it`);
    }
    if (dwells.length % EVERY === 0) progress?.(FOLLOWING, state.step / reference.q.length);
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
