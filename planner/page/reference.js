/* How the pivot moves while the tracked point follows a path, a tractrix; distances between points and polylines.
 *
 * A drift is {sideways, current: [x, y]}, as shares of the net speed along the heading. Lengths in l, angles in
 * rad. */
import { CONSTANTS } from "./constants.js";
import { clip, column, differences, halfTurn, largest, linspace, smallest, unwrap } from "./math.js";
import { arcLength, pointsAt, polyline, resample, stepLengths, stepsOf } from "./path.js";
import { InputError } from "./words.js";

const { LAPS, MOST_SLIP } = CONSTANTS.tractrix;
const { TIE } = CONSTANTS.distance; // difference of distances that are equal
const STILL = { sideways: 0, current: [0, 0] };
const RUN = 8; // segments in a smallest box
const MOST_FILLED = 4000; // points that are added to a polyline

/* Compute the tractrix of a path: {p, q, heading, arc, curvature, closed}, p of the tracked point, q of the pivot.
 *
 * heading is without jumps; arc is the arc length of q; curvature is the turn of the heading per length of q in
 * its steps. pivotDistance is the length of the rod; 0: the pivot itself is tracked. */
function reference(path, pivotDistance, spacing, drift = STILL) {
  const p = resample(polyline(path), spacing), dx = differences(column(p, 0)), dy = differences(column(p, 1));
  const tangent = unwrap(dx.map((x, i) => Math.atan2(dy[i], x)));
  const heading = pivotDistance <= 0 ? pivotHeading(tangent, path.closed, drift)
    : draggedHeading(tangent, stepLengths(p), pivotDistance, path.closed, drift);
  const q = p.map(([x, y], i) => {
    return [x - pivotDistance * Math.cos(heading[i]), y - pivotDistance * Math.sin(heading[i])];
  });
  const arc = arcLength(q), steps = differences(arc);
  const curvature = differences(heading).map((turn, i) => turn / Math.max(steps[i], 1e-9));
  return { p, q, heading, arc, curvature, closed: path.closed };
}

/* The heading where the pivot itself follows the path: the mean of the directions of two steps. */
function pivotHeading(tangent, closed, drift) {
  const last = tangent.length - 1, turn = closed ? turning(tangent) : 0;
  const before = closed ? tangent[last] - turn : tangent[0], after = closed ? tangent[0] + turn : tangent[last];
  const ends = [before, ...tangent, after];
  return Float64Array.from({ length: last + 2 }, (_, i) => {
    const angle = (ends[i + 1] + ends[i]) / 2;
    return angle - slipOf(angle, drift);
  });
}

/* The heading of a rod that is dragged; on a closed path for a few laps, until the motion repeats. */
function draggedHeading(tangent, length, pivotDistance, closed, drift) {
  let start = tangent[0] - slipOf(tangent[0], drift), heading;
  for (let lap = 0; lap < (closed ? LAPS : 1); lap++) {
    heading = drag(tangent, length, pivotDistance, start, drift);
    if (closed) start = heading[heading.length - 1] - turning(tangent);
  }
  return heading;
}

/* The total turn of a closed path: a multiple of 2π. */
function turning(tangent) {
  const first = tangent[0], last = tangent[tangent.length - 1];
  return last - first + halfTurn(first - last);
}

function isStill({ sideways, current: [x, y] }) {
  return sideways === 0 && x === 0 && y === 0;
}

/* The angle from the heading to a straight path in `direction`. */
function slipOf(direction, drift) {
  let slip = 0;
  if (!isStill(drift)) for (let i = 0; i < 50; i++) slip = Math.atan(ratio(direction - slip, drift));
  return slip;
}

/* The ratio of sideways to forward motion, (u + c·n)/(V + c·e). */
function ratio(heading, { sideways, current: [x, y] }) {
  const ahead = 1 + x * Math.cos(heading) + y * Math.sin(heading);
  const aside = sideways - x * Math.sin(heading) + y * Math.cos(heading);
  if (ahead > 0 && Math.abs(aside) <= MOST_SLIP * ahead) return aside / ahead;
  throw new InputError(
    "the current, or the difference of left and right turns, is as fast as the robot's net motion; use a longer "
    + "dwell or a faster motor",
  );
}

/* The heading along straight steps; exact without drift, where tan(δ/2) decays as exp(−s/a). */
function drag(tangent, length, pivotDistance, start, drift) {
  const heading = new Float64Array(tangent.length + 1), still = isStill(drift);
  let now = (heading[0] = start);
  for (let i = 0; i < tangent.length; i++) {
    const gap = halfTurn(tangent[i] - now), decay = Math.exp(-length[i] / pivotDistance);
    now += gap - 2 * Math.atan(Math.tan(gap / 2) * decay);
    if (!still) now -= (ratio(now, drift) * Math.max(Math.cos(gap), 0) * length[i]) / pivotDistance;
    heading[i + 1] = now;
  }
  return heading;
}

/* The distance of each point from a polyline. */
function distanceTo(line, points) {
  return nearest(line, points).distance;
}

/* Find the place on a polyline that is nearest to each point: columns distance, segment and share of it.
 *
 * Of segments whose distances differ by less than TIE the lowest number counts. */
function nearest(line, points) {
  const boxes = new Boxes(line), count = points.length;
  const distance = new Float64Array(count), segment = new Int32Array(count), share = new Float64Array(count);
  let last = 0;
  points.forEach((point, i) => {
    const least = boxes.leastGap(point, last);
    last = segment[i] = boxes.firstWithin(point, least + TIE);
    [distance[i], share[i]] = closest(line, last, point);
  });
  return { distance, segment, share };
}

/* The distance of a point from a segment, and the share of the segment where it is nearest. */
function closest(line, segment, [x, y]) {
  const [x0, y0] = line[segment], [x1, y1] = line[segment + 1];
  const dx = x1 - x0, dy = y1 - y0, awayX = x - x0, awayY = y - y0;
  const share = clip((awayX * dx + awayY * dy) / Math.max(dx * dx + dy * dy, 1e-300), 0, 1);
  return [Math.hypot(awayX - share * dx, awayY - share * dy), share];
}

/* A tree of boxes: those of the lowest level hold RUN segments each, all others two boxes of the level below. */
class Boxes {
  constructor(line) {
    this.line = line;
    this.count = line.length - 1;
    this.levels = [[]];
    for (let first = 0; first < this.count; first += RUN) {
      const some = line.slice(first, first + RUN + 1), x = column(some, 0), y = column(some, 1);
      this.levels[0].push([smallest(x), largest(x), smallest(y), largest(y)]);
    }
    for (let below = this.levels[0]; below.length > 1; below = this.levels[this.levels.length - 1]) {
      this.levels.push(below.filter((_, i) => i % 2 === 0).map(([left, right, low, high], i) => {
        const other = below[2 * i + 1] ?? below[2 * i];
        return [Math.min(left, other[0]), Math.max(right, other[1]), Math.min(low, other[2]), Math.max(high, other[3])];
      }));
    }
  }

  /* The smallest distance of a point from any segment; `guess` is a segment that is probably near. */
  leastGap(point, guess) {
    let [least] = closest(this.line, guess, point);
    this.visit(point, () => least, (segment) => {
      least = Math.min(least, closest(this.line, segment, point)[0]);
    });
    return least;
  }

  /* The lowest number of a segment that is not further from a point than `reach`. */
  firstWithin(point, reach) {
    let first = -1;
    this.visit(point, () => (first < 0 ? reach : -1), (segment) => {
      if (first < 0 && closest(this.line, segment, point)[0] <= reach) first = segment;
    });
    return first;
  }

  /* Visit the segments in boxes that are within reach(), in rising order. */
  visit([x, y], reach, seen) {
    const stack = [[this.levels.length - 1, 0]];
    while (stack.length) {
      const [level, i] = stack.pop(), [left, right, low, high] = this.levels[level][i];
      const away = Math.hypot(Math.max(left - x, x - right, 0), Math.max(low - y, y - high, 0));
      if (!(away * (1 - 1e-12) <= reach())) continue;
      if (level) {
        if (2 * i + 1 < this.levels[level - 1].length) stack.push([level - 1, 2 * i + 1]);
        stack.push([level - 1, 2 * i]);
      } else {
        const end = Math.min((i + 1) * RUN, this.count);
        for (let segment = i * RUN; segment < end; segment++) seen(segment);
      }
    }
  }
}

/* The largest distance of any point of the first polyline from the second, and the reverse. */
function twoSided(first, second) {
  return [largest(distanceTo(second, filled(first))), largest(distanceTo(first, filled(second)))];
}

/* Add points to a polyline, so that all steps are short compared with its length. */
function filled(line) {
  const lengths = arcLength(line), end = lengths[lengths.length - 1];
  const step = Math.max(smallest(differences(lengths)), end / MOST_FILLED);
  const count = clip(stepsOf(end, step), 2, MOST_FILLED);
  return pointsAt(line, lengths, Float64Array.from(new Set([...linspace(0, end, count), ...lengths])).sort());
}

export { STILL, reference, TIE, distanceTo, nearest, twoSided };
