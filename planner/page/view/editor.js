/* Drawing a stroke, setting and moving corners with the pointer, and corners as a table of numbers. Places in cm. */
import { bounds } from "../math.js";
import { element, figure } from "./dom.js";
import { lineData, pixelOf, tickStep } from "./scene.js";

const HANDLES = 80; // corners at most that are shown to be moved
const NEAR = 14; // pixels from a corner that count as on it
const JOINS = 0.08; // of a stroke's size: ends that are nearer make it a closed path
const ARM = 50; // pixels from a pose to the tip of its arrow
const DIRECTIONS = Math.PI / 12;

const WORDS = {
  move: "Drag or use arrow keys to move the picture; wheel, pinch, plus and minus zoom.",
  draw: "Draw a path with one stroke. Where it ends near its start, it is closed.",
  corners: "Click to add a corner, drag to move one, double-click to remove one.",
  keepOut: "Click the corners of a region that the robot must keep out of, then the first one again.",
  walls: "Click the corners of the walls that the robot must stay within, then the first one again.",
  goal: "Click where the robot is to go, and drag to set its heading. Start, goal and the tips of their arrows can be dragged.",
  many: "Its points are too many to be moved: click to begin a new path, corner by corner.",
};

class PathEditor {
  /* `finished(points, closed)` takes a stroke, `changed(points, closed, settled)` takes corners, `enclosed(points, mode)`
   * those of a region, `posed(start, goal)` poses as words. */
  constructor(finished, changed, enclosed, posed) {
    this.posed = posed;
    this.poses = [];
    this.enclosed = enclosed;
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
  take(path, poses = []) {
    this.path = path;
    this.poses = poses;
    this.begun = this.encloses ? this.begun ?? [] : null;
  }

  /* Choose what the pointer does; `anew`: corners are those of a new path. */
  use(mode, anew = false) {
    this.mode = mode;
    this.begun = anew || this.encloses ? [] : null;
  }

  /* The corners that can be moved: those of a new path, or of a path that has few. */
  get corners() {
    if (this.mode === "goal") return this.poses.flatMap((pose) => [pose.slice(0, 2), this.tipOf(pose)]);
    return this.begun ?? (this.path.points.length <= HANDLES ? this.path.points : []);
  }

  /* Where the arrow of a pose ends. */
  tipOf([x, y, heading]) {
    const arm = ARM / this.view.scale;
    return [x + arm * Math.cos(heading), y + arm * Math.sin(heading)];
  }

  /* Whether the corners are those of a region or of walls. */
  get encloses() {
    return this.mode === "keepOut" || this.mode === "walls";
  }

  /* What the pointer does, in words. */
  get words() {
    return WORDS[this.mode === "corners" && !this.begun && this.path.points.length > HANDLES ? "many" : this.mode];
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
    if (!["corners", "goal"].includes(this.mode) && !this.encloses) return false;
    const points = [...this.corners], index = points.findIndex((point) => this.near(point, place));
    if (index < 0 && this.mode === "goal") points.splice(2, 2, place, place);
    else if (index < 0) points.push(this.snapped(place, points[points.length - 1], event));
    this.held = { index: index < 0 ? points.length - 1 : index, points };
    return true;
  }

  near(point, place) {
    const [x, y] = pixelOf(this.view, point), [px, py] = pixelOf(this.view, place);
    return Math.hypot(x - px, y - py) < NEAR;
  }

  /* A place on the grid; with Shift, at a multiple of 15 degrees from the corner before. */
  snapped(place, before, event) {
    const [x, y] = place, step = tickStep(this.view) / 5;
    if (event.shiftKey && before) {
      const angle = Math.round(Math.atan2(y - before[1], x - before[0]) / DIRECTIONS) * DIRECTIONS;
      const along = (x - before[0]) * Math.cos(angle) + (y - before[1]) * Math.sin(angle);
      return [before[0] + along * Math.cos(angle), before[1] + along * Math.sin(angle)];
    }
    return this.snaps ? place.map((value) => Math.round(value / step) * step) : place;
  }

  drag(place, event) {
    if (this.stroke) this.stroke.push(place);
    if (!this.held) return;
    const { index, points } = this.held, [x, y] = points[index];
    points[index] = this.snapped(place, points[index - 1] ?? points[points.length - 1], event);
    if (this.mode !== "goal" || index % 2) return;
    const [right, up] = [points[index][0] - x, points[index][1] - y];
    points[index + 1] = [points[index + 1][0] + right, points[index + 1][1] + up];
  }

  release(place, event) {
    this.drag(place, event);
    const { stroke, held } = this;
    this.cancel();
    if (stroke && stroke.length > 2) this.finished(stroke, closes(stroke));
    if (!held) return;
    const [first] = held.points, added = held.points.length > this.corners.length;
    if (this.mode === "goal") {
      const [start, , goal, tip] = held.points;
      if (goal && this.near(goal, tip)) held.points[3] = goal.map((value, axis) => 2 * value - start[axis]);
      this.posed(poseWords(held.points), goal ? poseWords(held.points.slice(2)) : "");
    } else if (this.encloses) {
      const ends = !added && held.index === 0 && held.points.length > 2;
      this.begun = ends ? [] : held.points;
      if (ends) this.enclosed(held.points, this.mode);
    } else if (held.points.length < 2) this.begun = held.points;
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
    const shapes = [], points = this.held?.points ?? this.corners, line = this.stroke ?? (this.encloses ? points : this.held?.points);
    if (line) {
      const pixels = line.map((point) => pixelOf(view, point));
      const closed = !this.stroke && this.continues && this.path.closed;
      shapes.push(figure("path", { class: "stroke", d: lineData(pixels, closed) }));
    }
    if (this.mode === "goal") {
      const arrows = points.flatMap((tip, i) => (i % 2 ? lineData([points[i - 1], tip].map((end) => pixelOf(view, end))) : []));
      shapes.splice(0, 1, figure("path", { class: "stroke", d: arrows.join("") }));
    } else if (this.mode !== "corners" && !this.encloses) return shapes;
    return [...shapes, ...points.map((point, i) => {
      const [cx, cy] = pixelOf(view, point);
      return figure("circle", { class: i === this.held?.index ? "handle chosen" : "handle", cx, cy, r: 6 });
    })];
  }
}

/* A pose as words, X,Y,DEGREES, from its place and a point ahead. */
function poseWords([[x, y], [toX, toY]]) {
  const degrees = (Math.atan2(toY - y, toX - x) * 180) / Math.PI;
  return [...[x, y].map((value) => Math.round(value * 1000) / 1000), Math.round(10 * degrees) / 10].join(",");
}

/* Tell whether a stroke ends where it begins. */
function closes(stroke) {
  const [[x, y]] = stroke, away = stroke.map((point) => Math.hypot(point[0] - x, point[1] - y));
  return away[away.length - 1] < JOINS * Math.max(...away);
}

/* Fill `host` with the corners; `changed(points)` takes new ones. Focus stays where it is. */
function showCorners(host, points, changed) {
  if (points.length > HANDLES) {
    const words = `The path has ${points.length} points: more than can be typed or moved.`;
    host.replaceChildren(element("p", { class: "soft" }, words));
    return;
  }
  const focused = host.contains(document.activeElement) ? document.activeElement.getAttribute("aria-label") : null;
  const names = ["corner", "x [cm]", "y [cm]", ""].map((words) => element("th", { scope: "col" }, words));
  const rows = element("tbody", {}, points.map((_, i) => row(points, i, changed)));
  const add = element("button", { type: "button", click: () => changed([...points, after(points)]) }, "Add a corner");
  const table = element("table", {}, element("thead", {}, element("tr", {}, names)), rows);
  host.replaceChildren(element("div", { class: "wide" }, table), add);
  if (focused !== null) host.querySelector(`[aria-label="${focused}"]`)?.focus();
}

function row(points, i, changed) {
  const cells = [0, 1].map((axis) => {
    const set = ({ target }) => {
      if (Number.isFinite(target.valueAsNumber)) changed(points.with(i, points[i].with(axis, target.valueAsNumber)));
      else target.value = points[i][axis];
    };
    const name = `corner ${i + 1}, ${"xy"[axis]} in cm`;
    return element("input", { type: "number", step: "any", value: points[i][axis], change: set, "aria-label": name });
  });
  const remove = element("button", {
    type: "button", click: () => changed(points.toSpliced(i, 1)), disabled: points.length < 3,
    "aria-label": `remove corner ${i + 1}`,
  }, "×");
  const number = element("th", { scope: "row" }, String(i + 1));
  return element("tr", {}, number, [...cells, remove].map((cell) => element("td", {}, cell)));
}

/* The next corner: as far from the last one as that is from the one before. */
function after(points) {
  const [before, last] = points.slice(-2);
  return [2 * last[0] - before[0], 2 * last[1] - before[1]].map((value) => Math.round(value * 1000) / 1000);
}

/* Move, scale and turn points about their middle. */
function transformed(points, { right, up, scale, turn }) {
  const [midX, midY] = bounds(points).map(([low, high]) => (low + high) / 2);
  const angle = (turn * Math.PI) / 180, cos = scale * Math.cos(angle), sin = scale * Math.sin(angle);
  return points.map(([x, y]) => {
    const dx = x - midX, dy = y - midY;
    return [midX + right + cos * dx - sin * dy, midY + up + sin * dx + cos * dy];
  });
}

export { PathEditor, showCorners, transformed };
