/* tracker.h: the tracker in C with the tables of a plan that is followed once.
 *
 * Mirrors planner/files/tracker_header.py, and what it takes from planner/tracking/kalman_filter.py and
 * planner/tracking/guidance.py. The template is Python's, with @NAME@ in place of what a plan decides. */
import { hypot, largestSize } from "./arrays.js";
import { general, repr, roundHalfEven } from "./format.js";
import { lookAhead } from "./stated_error.js";
import { rodOf } from "./tracked_point.js";
import { COUNT, lagAt, lagPlace, pivotDistance, pivotRadius } from "./vehicle.js";
import { zigzagSpeed } from "./zigzag.js";

const A_LINE = 12; // numbers of a table
const LARGEST = 32_767;
const STATES = 13;
const START = [0.02, 0.02, 0.03]; // standard deviations of the first pose [l, rad]
const PRIOR = [0.03, 0.03, 0.03, 0.03]; // of yaw rates, surge and sway, beside the plan's own
const MARKER = [0.05, 0.05, 0.2]; // of the marker's place [l] and angle [rad]
const MOST = [0.5, 0.5, 0.5, 0.5, 0.3]; // bounds of the learned yaw rates, surge, sway, lag angle
const CURRENT = 0.07; // standard deviation of a current beside the plan's, in net speeds
const MOST_CURRENT = 0.5; // of the net speed
const MOST_MARKER = [0.5, 0.5, 1]; // l, rad
const NEAR = 0.5; // of the pivot's turn radius: the distance within which the guidance steers back
const ERRORS = 4; // or of the largest predicted error
const STRIDE = 0.5; // between two targets of a way back, in radii

/* Write tracker.h as text. id: of the plan. name: of the robot, safe in a comment. tracker_header */
function trackerHeader(plan, id, name, template) {
  const parts = {
    IDENTITY: id, NAME: name, MODEL: plan.tracked.model, BYTES: String(tableBytes(plan)), ...numbers(plan),
    ...tables(plan),
  };
  return template.replace(/@(\w+)@/g, (_, mark) => parts[mark]);
}

function tableBytes({ tracked: { vehicle }, declared }) {
  const lags = [...vehicle.lag, ...vehicle.rest].reduce((total, table) => total + table.length, 0);
  return 2 * lags + 4 * 3 * declared.reference.q.length;
}

/* The numbers that the plan decides. _numbers */
function numbers(plan) {
  const { tracked, straight, guidance, declared } = plan, { robot, vehicle } = tracked;
  const counts = {
    FIRST_DIRECTION: plan.switches.firstDirection, POINTS: declared.reference.q.length, LAP: 0, TIMES: COUNT,
    STRIDE: stride(plan),
  };
  const reals = {
    TIME_SCALE: robot.timeScale, TAIL_LENGTH_M: robot.tailLength, SHORTEST: guidance.dwell, AHEAD: guidance.ahead,
    ROD: rodOf(tracked), OFFSET: tracked.offset, LAP_TURN: 0, SWING: guidance.swing,
    PIVOT_RADIUS: pivotRadius(vehicle), NET_SPEED: straight.speed, NET_DRIFT: straight.drift,
    PIVOT_DISTANCE: pivotDistance(vehicle), WAY_AHEAD: lookAhead(vehicle, 0, straight), LIMIT: limit(plan),
  };
  return { ...mapped(counts, String), ...mapped(reals, repr) };
}

function mapped(values, write) {
  return Object.fromEntries(Object.entries(values).map(([name, value]) => [name, write(value)]));
}

/* The distance from the reference up to which the line of sight leads back. limit */
function limit({ tracked, errors }) {
  return Math.max(NEAR * pivotRadius(tracked.vehicle), ERRORS * errors.predictedMax);
}

/* The points of the reference from one target of a way back to the next. stride */
function stride({ tracked, declared }) {
  const { arc } = declared.reference, last = arc.length - 1, spacing = arc[last] / last;
  return Math.max(roundHalfEven((STRIDE * pivotRadius(tracked.vehicle)) / Math.max(spacing, 1e-9)), 1);
}

/* The tables that the plan decides. _tables */
function tables(plan) {
  const { tracked, declared, straight, switches } = plan, { vehicle } = tracked;
  const { q, heading } = declared.reference;
  const unit = lagUnit(vehicle), current = MOST_CURRENT * zigzagSpeed(straight);
  const [left, right] = vehicle.lag.map((lag) => table(inUnits(lag, unit), String));
  return {
    start: row(switches.poses[0]),
    twist: `{${vehicle.twist.map(row).join(", ")}}`,
    current: row(vehicle.current),
    most: row([...MOST, current, current, ...MOST_MARKER]),
    lag_unit: row(unit),
    prior: table(prior(plan).flat(), repr),
    path_x: table(q.map(([x]) => x), nine),
    path_y: table(q.map(([, y]) => y), nine),
    path_heading: table(heading, nine),
    rest: table(vehicle.rest.flatMap((rest) => inUnits(rest, unit)), String),
    lag_left: left,
    lag_right: right,
  };
}

/* The units of the lags, forward, left and heading. _lag_unit */
function lagUnit({ lag, rest }) {
  return [0, 1, 2].map((axis) => {
    const size = (values) => largestSize(values.filter((_, at) => at % 3 === axis));
    return Math.max(...[...lag, ...rest].map(size), 1e-12) / LARGEST;
  });
}

function inUnits(lags, unit) {
  return Array.from(lags, (value, at) => roundHalfEven(value / unit[at % 3]) || 0); // no −0
}

/* The covariance before the first pose, from what is uncertain of the start and the plan. prior */
function prior({ tracked: { vehicle }, straight, guidance: { dwell } }) {
  const squares = (sigmas) => sigmas.map((sigma) => sigma * sigma), { twist } = vehicle;
  const variances = [...squares(START), ...squares(PRIOR), 1e-6, 1e-12, 1e-12, ...squares(MARKER)];
  const covariance = variances.map((variance, i) => variances.map((_, j) => (i === j ? variance : 0)));
  const [[forward, left]] = twist, speed = hypot(forward, left);
  for (const mode of vehicle.modes) {
    const direction = Array(STATES).fill(0);
    for (const i of [0, 1]) {
      direction[3 + i] = mode.twist[i][2] / twist[i][2];
      const size = Math.max(twist[0][i] * twist[0][i], 1e-6 * (speed * speed));
      direction[5 + i] = (mode.twist[0][i] * twist[0][i]) / size;
      direction[8 + i] = mode.current[i];
    }
    if (mode.lag) direction[7] = lagAt(mode.lag[0], lagPlace(dwell, dwell))[2];
    for (let i = 0; i < STATES; i++) {
      for (let j = 0; j < STATES; j++) covariance[i][j] += direction[i] * direction[j];
    }
  }
  for (const i of [8, 9]) covariance[i][i] += (CURRENT * zigzagSpeed(straight)) ** 2;
  return covariance;
}

function nine(value) {
  return general(value, 9);
}

function row(values) {
  return `{${Array.from(values, repr).join(", ")}}`;
}

/* Write values as one row in C, over several lines. _table */
function table(values, write) {
  const texts = Array.from(values, (value) => write(value)), lines = [];
  for (let i = 0; i < texts.length; i += A_LINE) lines.push(texts.slice(i, i + A_LINE).join(", "));
  return `{\n${lines.join(",\n")}}`;
}

export { trackerHeader };
