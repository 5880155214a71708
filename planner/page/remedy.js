/* What helps a path that is too tight: smoothing or a scale, tried before it is recommended.
 *
 * Mirrors planner/planning/remedy.py. The search is bounded by its work, counted in poses of the nearest path.
 * Lengths in l. */
import { LOST, asDrawn, changed, costOf, smoothingOfNoise, waysOf } from "./feasible.js";
import { general } from "./format.js";
import { pathLength, scaled, smoothed } from "./path.js";
import { REMEDY, tell } from "./progress.js";
import { LONGEST, extent, inLab } from "./units.js";
import { turnRadius } from "./vehicle.js";

const SCALES = [1.5, 2.0, 2.5, 3.5, 5.0, 7.5, 12.0, 20.0];
const MOST_WORK = 20_000.0; // poses of the nearest path
const SMOOTHINGS = [1.0, 1.5, 2.2, 3.2, 4.7, 7.0]; // over the length that shows noise
const FIRST = 0.5; // of the turn radius: the first length over which a path that is not noisy is smoothed

/* Say what helps a path that is too tight. */
function remedy(raw, feasibility, progress = null) {
  const search = new Search(feasibility, progress), { robot } = feasibility;
  const noise = smoothingOfNoise(raw, feasibility.vehicle);
  if (noise !== null) {
    const smooth = search.smoothing(raw, noise, LOST);
    if (smooth === null) {
      return "it looks noisy, and no smoothing was found that keeps its shape: draw it with less noise";
    }
    return (
      `it looks noisy: smoothed over ${inLab(smooth.length, robot)} it is ` +
      `${inLab(pathLength(smooth.path), robot)} long, not ${inLab(pathLength(raw), robot)}, and moves by up to ` +
      `${inLab(smooth.moved, robot)}; give --smooth ${general(smooth.length)}l`
    );
  }
  const scale = search.scale(raw);
  if (scale !== null) return `scale the path by ${general(scale, 3)}`;
  const smooth = search.smoothing(raw, FIRST * turnRadius(feasibility.vehicle), LOST);
  if (smooth === null) {
    return "draw it with wider turns: neither a larger scale nor smoothing was found to help";
  }
  return (
    `smooth it over ${inLab(smooth.length, robot)}, which moves it by up to ${inLab(smooth.moved, robot)}: give ` +
    `--smooth ${general(smooth.length)}l`
  );
}

/* A search whose work is bounded. */
class Search {
  constructor(feasibility, progress) {
    this.feasibility = feasibility;
    this.progress = progress;
    this.work = 0;
  }

  /* Count work, unless it is more than is left. */
  allowed(work) {
    if (this.work + work > MOST_WORK) return false;
    this.work += work;
    this.tell();
    return true;
  }

  /* Tell that the search goes on. */
  tell() {
    tell(this.progress, REMEDY, this.work / MOST_WORK);
  }

  /* The path as drawn (null), and every other way to change it, the cheapest first. */
  ways() {
    return [null, ...[...waysOf(this.feasibility)].reverse().filter((_, i) => i % 2 === 0)];
  }

  /* Try one way; false where no work is left for it, too. */
  works(path, way) {
    if (way === null) return asDrawn(path, this.feasibility) !== null;
    if (smoothingOfNoise(path, this.feasibility.vehicle) !== null) return false;
    if (!this.allowed(costOf(path, this.feasibility, way))) return false;
    return changed(path, this.feasibility, way, () => this.tell()) !== null;
  }

  /* Find a small one of SCALES at which the path is accepted, by bisection; null if there is none. */
  scale(raw) {
    const whole = pathLength(raw), scales = SCALES.filter((scale) => whole * scale < LONGEST);
    let best = scales.length;
    for (const way of this.ways()) {
      let low = 0, high = best;
      while (low < high) {
        const middle = Math.floor((low + high) / 2);
        if (this.works(scaled(raw, scales[middle]), way)) best = high = middle;
        else low = middle + 1;
      }
    }
    return best < scales.length ? scales[best] : null;
  }

  /* Find a length over which the path, smoothed, is accepted: {length, path, moved}; null if there is none.
   *
   * first: length to begin with. most: share of the path's extent by which smoothing may move it. */
  smoothing(raw, first, most) {
    for (const share of SMOOTHINGS) {
      const length = Number(general(first * share, 2));
      if (!(length < pathLength(raw) / 2)) return null;
      const { path, moved } = smoothed(raw, length);
      if (moved > most * Math.max(...extent(raw))) return null;
      if (this.ways().some((way) => this.works(path, way))) return { length, path, moved };
    }
    return null;
  }
}

export { remedy };
