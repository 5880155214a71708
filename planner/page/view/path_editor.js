/* Drawing a stroke, and setting and moving corners, with the pointer. Places in cm. */

import { figure } from "./dom.js";
import { lineData } from "./scene.js";
import { pixelOf, tickStep } from "./viewport.js";

const HANDLES = 80; // corners at most that are shown to be moved
const NEAR = 14; // pixels from a corner that count as on it
const JOINS = 0.08; // of a stroke's size: ends that are nearer make it a closed path
const DIRECTIONS = Math.PI / 12;

const WORDS = {
  move: "Drag or use arrow keys to move the picture; wheel, pinch, plus and minus zoom.",
  draw: "Draw a path with one stroke. Where it ends near its start, it is closed.",
  corners: "Click to add a corner, drag to move one, double-click to remove one.",
};

class PathEditor {
  /* `finished(points, closed)` takes a stroke, `changed(points, closed, settled)` takes corners. */
  constructor(finished, changed) {
    this.finished = finished;
    this.changed = changed;
    this.mode = "move";
    this.path = { points: [], closed: false };
    this.begun = null; // the corners of a new path as long as they are too few for one
    this.stroke = null;
    this.held = null;
    this.snaps = false;
    this.view = null;
  }

  /* Show a path. */
  take(path) {
    this.path = path;
    this.begun = null;
  }

  /* Choose what the pointer does; `anew`: corners are those of a new path. */
  use(mode, anew = false) {
    this.mode = mode;
    this.begun = anew ? [] : null;
  }

  /* The corners that can be moved: those of a new path, or of a path that has few. */
  get corners() {
    return this.begun ?? (this.path.points.length <= HANDLES ? this.path.points : []);
  }

  /* Whether the corners are those of the path. */
  get continues() {
    return this.corners === this.path.points;
  }

  press(place, event) {
    if (this.mode === "draw") {
      this.stroke = [place];
      return true;
    }
    if (this.mode !== "corners") return false;
    const points = this.corners;
    const index = points.findIndex((point) => this.near(point, place));
    if (index >= 0) {
      this.held = { index, points: [...points] };
      return true;
    }
    const placed = this.snapped(place, points[points.length - 1], event);
    this.held = { index: points.length, points: [...points, placed] };
    return true;
  }

  near(point, place) {
    const [x, y] = pixelOf(this.view, point), [px, py] = pixelOf(this.view, place);
    return Math.hypot(x - px, y - py) < NEAR;
  }

  /* A place on the grid; with Shift, at a multiple of 15 degrees from the corner before. */
  snapped(place, before, event) {
    let [x, y] = place;
    if (event.shiftKey && before) {
      const angle = Math.round(Math.atan2(y - before[1], x - before[0]) / DIRECTIONS) * DIRECTIONS;
      const along = (x - before[0]) * Math.cos(angle) + (y - before[1]) * Math.sin(angle);
      return [before[0] + along * Math.cos(angle), before[1] + along * Math.sin(angle)];
    }
    if (!this.snaps) return place;
    const step = tickStep(this.view) / 5;
    [x, y] = [Math.round(x / step) * step, Math.round(y / step) * step];
    return [x, y];
  }

  drag(place, event) {
    if (this.stroke) this.stroke.push(place);
    if (!this.held) return;
    const { index, points } = this.held;
    points[index] = this.snapped(place, points[index - 1] ?? points[points.length - 1], event);
  }

  release(place, event) {
    this.drag(place, event);
    const { stroke, held } = this;
    this.cancel();
    if (stroke && stroke.length > 2) this.finished(stroke, closes(stroke));
    if (!held) return;
    const first = held.points[0];
    const added = held.points.length > this.corners.length;
    if (held.points.length < 2) this.begun = held.points;
    else if (added && held.points.length > 3 && this.near(first, held.points[held.index])) {
      this.changed(held.points.slice(0, -1), true);
    } else this.changed(held.points, this.continues && this.path.closed);
  }

  /* Remove the corner at a place. */
  remove(place) {
    if (this.mode !== "corners" || !this.continues) return;
    const kept = this.path.points.filter((point) => !this.near(point, place));
    if (kept.length < this.path.points.length) this.changed(kept, this.path.closed && kept.length > 2);
  }

  cancel() {
    this.stroke = null;
    this.held = null;
  }

  /* What is drawn over the picture [pixels]. */
  overlay(view) {
    this.view = view;
    const shapes = [];
    const points = this.held?.points ?? this.corners;
    const line = this.stroke ?? (this.held ? points : null);
    if (line) {
      const pixels = line.map((point) => pixelOf(view, point));
      const closed = !this.stroke && this.continues && this.path.closed;
      shapes.push(figure("path", { class: "stroke", d: lineData(pixels, closed) }));
    }
    if (this.mode === "corners") {
      points.forEach((point, i) => {
        const [cx, cy] = pixelOf(view, point);
        shapes.push(figure("circle", { class: i === this.held?.index ? "handle chosen" : "handle", cx, cy, r: 6 }));
      });
    }
    return shapes;
  }
}

/* Tell whether a stroke ends where it begins. */
function closes(stroke) {
  const [x, y] = stroke[0];
  const size = Math.max(...stroke.map((point) => Math.hypot(point[0] - x, point[1] - y)));
  const end = stroke[stroke.length - 1];
  return Math.hypot(end[0] - x, end[1] - y) < JOINS * size;
}

export { HANDLES, PathEditor, WORDS, closes };
