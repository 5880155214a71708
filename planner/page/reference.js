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
  points.forEach(([x, y], i) => {
    const square = boxes.leastSquare(x, y, last);
    last = segment[i] = boxes.firstWithin(x, y, (Math.sqrt(square) + TIE) ** 2);
    distance[i] = Math.sqrt(boxes.squareTo(last, x, y));
    share[i] = boxes.share;
  });
  return { distance, segment, share };
}

/* A tree of boxes around a polyline: those of the lowest level hold RUN segments each, all others two of the level below. */
class Boxes {
  constructor(line) {
    this.x = column(line, 0);
    this.y = column(line, 1);
    this.count = line.length - 1;
    const runs = Array.from({ length: Math.ceil(this.count / RUN) }, (_, i) => {
      const x = this.x.subarray(i * RUN, (i + 1) * RUN + 1), y = this.y.subarray(i * RUN, (i + 1) * RUN + 1);
      return [Math.min(...x), Math.max(...x), Math.min(...y), Math.max(...y)];
    });
    this.levels = [Float64Array.from(runs.flat())];
    for (let below = this.levels[0]; below.length > 4; below = this.levels[this.levels.length - 1]) {
      this.levels.push(Float64Array.from({ length: 4 * Math.ceil(below.length / 8) }, (_, at) => {
        const one = 8 * (at >> 2) + (at & 3), other = one + 4 < below.length ? one + 4 : one;
        return at & 1 ? Math.max(below[one], below[other]) : Math.min(below[one], below[other]);
      }));
    }
  }

  /* The squared distance of a place from a segment; leaves the share of the segment where it is nearest. */
  squareTo(segment, x, y) {
    const fromX = this.x[segment], fromY = this.y[segment], dx = this.x[segment + 1] - fromX;
    const dy = this.y[segment + 1] - fromY, square = dx * dx + dy * dy;
    const along = square > 0 ? ((x - fromX) * dx + (y - fromY) * dy) / square : 0;
    this.share = along < 0 ? 0 : along > 1 ? 1 : along;
    const awayX = x - fromX - this.share * dx, awayY = y - fromY - this.share * dy;
    return awayX * awayX + awayY * awayY;
  }

  /* The smallest squared distance from any segment; `guess` is a segment that is probably near. */
  leastSquare(x, y, guess, level = this.levels.length - 1, i = 0, known = this.squareTo(guess, x, y)) {
    let least = known;
    if (!(this.squareOf(level, i, x, y) <= least)) return least;
    if (level) {
      least = this.leastSquare(x, y, guess, level - 1, 2 * i, least);
      return 8 * i + 4 < this.levels[level - 1].length ? this.leastSquare(x, y, guess, level - 1, 2 * i + 1, least) : least;
    }
    const end = Math.min((i + 1) * RUN, this.count);
    for (let segment = i * RUN; segment < end; segment++) least = Math.min(least, this.squareTo(segment, x, y));
    return least;
  }

  /* The lowest number of a segment that is not further than the root of `reach`; −1: there is none. */
  firstWithin(x, y, reach, level = this.levels.length - 1, i = 0) {
    if (!(this.squareOf(level, i, x, y) <= reach)) return -1;
    if (level) {
      const first = this.firstWithin(x, y, reach, level - 1, 2 * i);
      return first >= 0 || 8 * i + 4 >= this.levels[level - 1].length ? first
        : this.firstWithin(x, y, reach, level - 1, 2 * i + 1);
    }
    const end = Math.min((i + 1) * RUN, this.count);
    for (let segment = i * RUN; segment < end; segment++) if (this.squareTo(segment, x, y) <= reach) return segment;
    return -1;
  }

  /* The squared distance of a place from a box, and a little less, for rounding. */
  squareOf(level, i, x, y) {
    const box = this.levels[level], at = 4 * i;
    const awayX = Math.max(box[at] - x, x - box[at + 1], 0), awayY = Math.max(box[at + 2] - y, y - box[at + 3], 0);
    return (awayX * awayX + awayY * awayY) * (1 - 1e-12);
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
