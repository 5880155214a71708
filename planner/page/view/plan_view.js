/* The large picture and its lens: layers, zoom, pan; by mouse, pen, finger and keyboard. */
import { byId, figure } from "./dom.js";
import { axesOf, fitted, flips, lensPlace, panned, placeAt, planLayers, poseTransform, robotShape } from "./scene.js";
import { transform, viewport, zoomed } from "./scene.js";

const LENS = 10; // times larger than the picture
const LENS_MARGIN = 10; // pixels from the edges, as in page.css
const KEYS = {
  ArrowLeft: (view) => view.pan(60, 0), ArrowRight: (view) => view.pan(-60, 0), ArrowUp: (view) => view.pan(0, 60),
  ArrowDown: (view) => view.pan(0, -60), "+": (view) => view.zoom(1.25), "=": (view) => view.zoom(1.25),
  "-": (view) => view.zoom(0.8), 0: (view) => view.fit(),
};

class PlanView {
  /* `editor` has press, drag, release(place, event) → whether it takes the gesture, and overlay(view). */
  constructor() {
    this.svg = byId("view");
    this.lens = byId("lens");
    this.view = viewport(10, 0, 0);
    this.content = { drawn: null, plan: null, tracks: [], old: false };
    this.pointers = new Map();
    this.editor = null;
    this.pose = null;
    this.follows = null; // the place [cm] that the lens shows
    this.moved = false; // whether the user has chosen the viewport
    this.layers = figure("g", { id: "scene" });
    for (const name of ["grid", "flips", "robot", "axes", "overlay", "lensFlips"]) this[name] = figure("g");
    this.scene = figure("g", {}, this.layers, this.flips, this.robot);
    this.svg.append(this.grid, this.scene, this.axes, this.overlay);
    this.lensScene = figure("g", {}, figure("use", { href: "#scene" }), this.lensFlips);
    this.lensMark = figure("path", { class: "mark" });
    this.lensWords = figure("text", { "text-anchor": "middle" });
    this.lens.append(this.lensScene, this.lensMark, this.lensWords);
    this.listen();
  }

  get size() {
    return [this.svg.clientWidth || 600, this.svg.clientHeight || 400];
  }

  /* Show what is drawn and planned. A new path is fitted unless the user has moved the picture. */
  show(content) {
    this.content = content;
    this.layers.replaceChildren(planLayers(content));
    if (!this.moved) this.fit();
    else this.place();
  }

  /* Show the robot at a pose [cm, rad]; null: none. */
  showRobot(body, pose) {
    if (this.body !== body) {
      this.robot.replaceChildren(...(body ? [robotShape(body)] : []));
      this.body = body;
    }
    this.robot.style.display = pose ? "" : "none";
    if (!pose) return;
    this.robot.setAttribute("transform", poseTransform(pose));
    this.follows = pose;
    this.placeLens();
  }

  /* The points that are to be seen. */
  shown() {
    const { drawn, plan, tracks } = this.content;
    const { keepOut = [], walls } = drawn?.space ?? {}, regions = walls ? [walls, ...keepOut] : keepOut;
    const ends = regions.flatMap(({ x, y, radius, corners }) => corners ?? [[x - radius, y - radius], [x + radius, y + radius]]);
    const poses = drawn?.poses?.length > 1 ? drawn.poses : [];
    return [...(drawn?.points ?? []), ...poses, ...ends, ...(plan?.reference ?? []), ...tracks.flatMap((track) => track.points)];
  }

  fit() {
    this.view = fitted(this.shown(), ...this.size);
    this.moved = false;
    this.place();
  }

  /* Put all groups where the viewport has them, and the lens where it hides least. */
  place() {
    const [width, height] = this.size;
    const lens = (this.lens.clientWidth || 200) + 2 * LENS_MARGIN;
    this.lensPlace = lensPlace(this.view, this.shown(), width, height, lens);
    this.scene.setAttribute("transform", transform(this.view));
    const { grid, axes } = axesOf(this.view, width, height);
    this.grid.replaceChildren(grid);
    this.axes.replaceChildren(axes);
    const dots = this.content.plan ? flips(this.content.plan, this.view) : null;
    this.flips.replaceChildren(...(dots ? [dots] : []));
    this.overlay.replaceChildren(...(this.editor?.overlay(this.view) ?? []));
    this.placeLens();
  }

  placeLens() {
    const { plan } = this.content;
    this.lens.style.display = plan ? "" : "none";
    if (!plan) return;
    this.lens.setAttribute("class", this.lensPlace);
    const [x, y] = this.follows ?? plan.start, size = this.lens.clientWidth || 200, scale = LENS * this.view.scale;
    const view = { scale, left: size / 2 - scale * x, top: size / 2 + scale * y };
    this.lensScene.setAttribute("transform", transform(view));
    const near = plan.flips.filter((flip) => Math.hypot(flip[0] - x, flip[1] - y) * scale < size);
    const dots = near.length ? flips({ ...plan, flips: near }, view) : null;
    this.lensFlips.replaceChildren(...(dots ? [dots] : []));
    this.lensMark.setAttribute("d", `M${size / 2 - 7},${size / 2}h14M${size / 2},${size / 2 - 7}v14`);
    this.lensWords.setAttribute("x", size / 2);
    this.lensWords.setAttribute("y", size - 14);
    this.lensWords.textContent = `× ${LENS}`;
  }

  zoom(factor, x = this.size[0] / 2, y = this.size[1] / 2) {
    this.view = zoomed(this.view, factor, x, y);
    this.moved = true;
    this.place();
  }

  pan(right, down) {
    this.view = panned(this.view, right, down);
    this.moved = true;
    this.place();
  }

  pixels(event) {
    const box = this.svg.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  /* The place [cm] under a pointer. */
  placeOf(event) {
    return placeAt(this.view, ...this.pixels(event));
  }

  listen() {
    const { svg } = this;
    svg.addEventListener("pointerdown", (event) => this.press(event));
    svg.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) svg.addEventListener(name, (event) => this.release(event));
    const zoom = (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY / 500), ...this.pixels(event));
    };
    svg.addEventListener("wheel", zoom, { passive: false });
    const pinch = (event) => event.touches.length > 1 && event.preventDefault();
    svg.addEventListener("touchmove", pinch, { passive: false });
    svg.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => (this.moved ? this.place() : this.fit())).observe(svg);
  }

  press(event) {
    if (event.button > 0) return;
    this.pointers.set(event.pointerId, this.pixels(event));
    this.editing = this.pointers.size === 1 && this.editor?.press(this.placeOf(event), event) === true;
    if (this.pointers.size > 1) this.editor?.cancel();
    if (this.editing || event.pointerType !== "touch" || this.pointers.size > 1) {
      this.svg.setPointerCapture(event.pointerId);
    }
  }

  move(event) {
    const before = this.pointers.get(event.pointerId), now = this.pixels(event);
    if (!before) {
      this.hover(event);
      return;
    }
    if (this.pointers.size === 2) this.pinch(event.pointerId, before, now);
    else if (this.editing) {
      for (const step of event.getCoalescedEvents?.() ?? [event]) this.editor.drag(this.placeOf(step), step);
      this.overlay.replaceChildren(...this.editor.overlay(this.view));
      this.hover(event);
    } else if (event.pointerType !== "touch") this.pan(now[0] - before[0], now[1] - before[1]);
    this.pointers.set(event.pointerId, now);
  }

  hover(event) {
    if (this.playing) return;
    this.follows = this.placeOf(event);
    this.placeLens();
  }

  /* Two fingers: their middle pans, their distance zooms. */
  pinch(id, before, now) {
    const [other] = [...this.pointers].filter(([key]) => key !== id).map(([, place]) => place);
    const apart = ([x, y]) => Math.hypot(x - other[0], y - other[1]);
    this.view = panned(this.view, (now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    this.zoom(apart(now) / Math.max(apart(before), 1), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  }

  release(event) {
    if (!this.pointers.delete(event.pointerId) || !this.editing) return;
    this.editing = false;
    if (event.type === "pointercancel") this.editor.cancel();
    else this.editor.release(this.placeOf(event), event);
    this.place();
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
    KEYS[event.key](this);
    event.preventDefault();
  }
}

export { PlanView };
