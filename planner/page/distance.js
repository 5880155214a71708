/* Distances between points and polylines: boxes around runs of segments leave out what is far.
 *
 * Mirrors planner/paths/distance.py. Any unit of length. */
import { differences, interp, largest, linspace, smallest, column } from "./arrays.js";
import { arcLength, stepsOf } from "./path.js";

const TIE = 1e-12; // difference of distances that are equal
const RUN = 8; // segments in a smallest box
const MOST_FILLED = 4000; // points that are added to a polyline

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
  for (let i = 0; i < count; i++) {
    const least = boxes.leastGap(points[i], last);
    last = segment[i] = boxes.firstWithin(points[i], least + TIE);
    const place = closest(line, last, points[i]);
    distance[i] = place.gap;
    share[i] = place.share;
  }
  return { distance, segment, share };
}

/* The distance of a point from a segment, and the share of the segment where it is nearest. */
function closest(line, segment, [x, y]) {
  const [x0, y0] = line[segment], [x1, y1] = line[segment + 1];
  const dx = x1 - x0, dy = y1 - y0, awayX = x - x0, awayY = y - y0;
  const share = Math.min(Math.max((awayX * dx + awayY * dy) / Math.max(dx * dx + dy * dy, 1e-300), 0), 1);
  return { gap: Math.hypot(awayX - share * dx, awayY - share * dy), share };
}

/* A tree of boxes: those of the lowest level hold RUN segments each, all others two boxes of the level below. */
class Boxes {
  constructor(line) {
    this.line = line;
    this.count = line.length - 1;
    const lowest = [];
    for (let first = 0; first < this.count; first += RUN) {
      const some = line.slice(first, first + RUN + 1), x = column(some, 0), y = column(some, 1);
      lowest.push([smallest(x), largest(x), smallest(y), largest(y)]);
    }
    this.levels = [lowest];
    for (let level = lowest; level.length > 1; this.levels.push(level)) {
      const below = level;
      level = [];
      for (let i = 0; i < below.length; i += 2) level.push(around(below[i], below[i + 1] ?? below[i]));
    }
  }

  /* The smallest distance of a point from any segment; `guess` is a segment that is probably near. */
  leastGap(point, guess) {
    let least = closest(this.line, guess, point).gap;
    this.visit(point, () => least, (segment) => {
      least = Math.min(least, closest(this.line, segment, point).gap);
    });
    return least;
  }

  /* The lowest number of a segment that is not further from a point than `reach`. */
  firstWithin(point, reach) {
    let first = -1;
    this.visit(point, () => (first < 0 ? reach : -1), (segment) => {
      if (first < 0 && closest(this.line, segment, point).gap <= reach) first = segment;
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

/* The box around two boxes. */
function around(one, other) {
  const [left, right, low, high] = one;
  return [
    Math.min(left, other[0]), Math.max(right, other[1]), Math.min(low, other[2]), Math.max(high, other[3]),
  ];
}

/* The largest distance of any point of the first polyline from the second, and the reverse. */
function twoSided(first, second) {
  return [largest(distanceTo(second, filled(first))), largest(distanceTo(first, filled(second)))];
}

/* Add points to a polyline, so that all steps are short compared with its length. */
function filled(line) {
  const lengths = arcLength(line), end = lengths[lengths.length - 1];
  const step = Math.max(smallest(differences(lengths)), end / MOST_FILLED);
  const count = Math.max(2, Math.min(MOST_FILLED, stepsOf(end, step)));
  const at = Float64Array.from(new Set([...linspace(0, end, count), ...lengths])).sort();
  const x = interp(at, lengths, column(line, 0)), y = interp(at, lengths, column(line, 1));
  return Array.from(x, (value, i) => [value, y[i]]);
}

export { TIE, distanceTo, nearest, twoSided };
