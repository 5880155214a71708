/* The page: what the user changes, what is planned for it, and what is shown. */
import { inflated } from "../data.js";
import { runningSum, sum } from "../math.js";
import { inPage } from "../words.js";
import { chart, marker, tradeOff } from "./charts.js";
import { byId, pictureText, save, say } from "./dom.js";
import { PathEditor, showCorners } from "./editor.js";
import { askUnit, oneFile, Problem } from "./files.js";
import { connect, RobotForm, showMeasured, showMotion, showResults, summary } from "./panels.js";
import { PlanView } from "./plan_view.js";
import { PlannerClient } from "./planner_client.js";
import { Player } from "./player.js";
import { Runs, showTrack } from "./runs.js";
import { addressOf, fromAddress, History, labValues, onGrid, pointsRefusal, wishOf } from "./state.js";

const MARK = 0.2; // mean turn radii, length of a vehicle without a size in the picture
const PAUSE = 120; // ms after the last change that goes on, such as by a slider, until a plan begins

class Page {
  /* `data` is what Python has written, `planner` the text of the worker. */
  constructor(data, planner) {
    this.data = data;
    this.planner = planner;
    this.robots = new Map(data.robots.map((robot) => [robot.name, robot]));
    this.client = new PlannerClient(() => this.worker(), (words) => this.problem(words));
    this.view = new PlanView();
    const drawn = (points, closed) => this.smooth(points, closed, "my stroke");
    const enclosed = (points, kind) => this.enclose(points, kind);
    this.editor = new PathEditor(drawn, (points, closed) => this.setPoints(points, closed), enclosed,
      (start, goal) => this.change({ options: { ...this.state.options, start, goal } }));
    this.view.editor = this.editor;
    this.player = new Player((pose, time) => this.played(pose, time));
    this.form = new RobotForm(data.limits, (values, key) => this.setRobot(values, key), () => this.history.settle());
    const { robot, shape, options } = data.first, { fields } = this.robots.get(robot);
    this.measured = fields.measured ? fields : null; // a vehicle that is not a robot
    this.initial = { robot: { name: robot, values: labValues(fields) }, path: this.ofShape(shape), options };
    this.plan = null;
    this.refused = false; // whether the newest wish is
    this.track = null;
    this.charts = new Map(); // name: a function that draws it
    this.fileProblem = new Problem();
    this.linkProblem = new Problem(); // until the next change
    this.runs = new Runs((content, use) => this.ask("runs", content, use), () => this.saveFile("robot.toml"));
    this.timer = null;
    this.questions = 0; // that are not answered
  }

  /* Read the address, connect the controls, and plan; show the first plan that Python has made, if there is one. */
  start(plan) {
    const { state, problem } = this.address();
    this.history = new History(state);
    this.linkProblem.tell("path", problem);
    connect(this);
    if (this.measured) showMeasured(this.measured);
    this.refresh();
    if (plan && state === this.initial) this.planned({ answer: plan }, this.wish());
    this.planNow();
  }

  /* The state that the address holds: {state, problem}. */
  address() {
    const shapes = this.data.shapes.map((shape) => shape.name);
    return fromAddress(location.hash.slice(1), this.initial, shapes, this.data.locked);
  }

  worker() {
    const worker = new Worker(URL.createObjectURL(new Blob([this.planner], { type: "text/javascript" })));
    worker.postMessage({ id: 0, what: "start", content: this.data.planner });
    return worker;
  }

  /* The path of a shape that the page offers. */
  ofShape(shape) {
    const { name, points, closed, size } = this.data.shapes.find((candidate) => candidate.name === shape);
    return points ? { points, closed, name } : { shape: name, size };
  }

  get state() {
    return this.history.state;
  }

  change(part, kind = null) {
    this.linkProblem.tell("path", "");
    if (this.history.change({ ...this.state, ...part }, kind)) this.refresh(kind !== null);
  }

  /* Show the state in all controls, and plan it. `more`: it changes further, such as by a slider, and the address
   * waits for the end; browsers refuse more than some changes of it a second. */
  refresh(more = false) {
    const { robot, path, options } = this.state;
    this.form.show(robot.values);
    byId("robot-name").value = this.robots.has(robot.name) ? robot.name : "";
    const shape = this.data.shapes.find(({ name }) => name === path.shape);
    byId("shape").value = path.shape ?? this.data.shapes.find(({ name }) => name === path.name)?.name ?? "";
    byId("size").disabled = !shape;
    byId("size-words").textContent = shape?.sizeWords ?? "Size";
    if (byId("size") !== document.activeElement) byId("size").value = path.size ?? "";
    for (const key of Object.keys(options)) {
      const control = byId(key);
      if (control !== document.activeElement) control.value = options[key] ?? "";
    }
    this.hint();
    byId("undo").disabled = !this.history.has(-1);
    byId("redo").disabled = !this.history.has(1);
    if (!more) this.writeAddress();
    const wish = JSON.stringify(this.wish());
    if (wish === this.wished) return; // else a refusal would leave, and move the button that it tells to press
    this.wished = wish;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.planNow(), more ? PAUSE : 0);
    this.mark();
    this.drawPath();
  }

  writeAddress() {
    const address = `#${addressOf(this.state, this.initial)}`;
    if (address !== (location.hash || "#")) history.replaceState(null, "", address);
  }

  /* The state as the planner takes it: SI units and options. */
  wish() {
    return wishOf(this.state, this.robots.get(this.state.robot.name)?.fields ?? {});
  }

  drawPath() {
    return this.ask("path", this.wish(), ({ answer, refusal }) => {
      say(byId("path-problem"), refusal ?? this.linkProblem.words, true);
      if (refusal) return;
      this.drawn = answer;
      this.editor.take(answer.corners, answer.poses);
      this.hint();
      byId("close").textContent = answer.closed ? "Part the ends" : "Join the ends";
      showCorners(byId("corner-table"), this.editor.path.points, (points) => this.setPoints(points, answer.closed));
      this.show();
    });
  }

  /* Mark whether a plan or an answer is on its way, for screen readers and for programs that wait. */
  mark() {
    const busy = this.questions > 0 || this.timer !== null || this.client.wish !== null || this.client.planning !== null;
    document.body.dataset.busy = busy ? "1" : "0";
    byId("view").setAttribute("aria-busy", String(busy));
  }

  /* Ask the planner, and count the question as long as `use` takes to use the answer. */
  async ask(what, content, use) {
    this.count(1);
    const answer = await this.client.ask(what, content);
    try {
      if (!answer.stopped) await use(answer);
    } finally {
      this.count(-1);
    }
  }

  /* Count a question that begins (1) or ends (-1). */
  count(step) {
    this.questions += step;
    this.mark();
  }

  async planNow() {
    clearTimeout(this.timer);
    this.timer = null;
    this.writeAddress();
    const wish = this.wish();
    if (!this.measured) this.client.ask("steady", wish).then((answer) => answer.stopped || showMotion(answer));
    this.runs.compare(wish.robot);
    const progress = ({ stage, done }) => say(byId("progress"), `Planning: ${stage}, ${Math.round(100 * done)} %`);
    this.client.plan({ content: wish, began: () => this.began(), progress, done: (answer) => this.planned(answer, wish) });
  }

  began() {
    this.old = this.plannedFor !== this.state;
    clearTimeout(this.slow);
    this.slow = setTimeout(() => {
      byId("stop").hidden = false;
      say(byId("progress"), "Planning…");
    }, 700);
  }

  /* No plan is being made any more. */
  ended() {
    clearTimeout(this.slow);
    byId("stop").hidden = true;
    say(byId("progress"), "");
    this.mark();
  }

  planned(answer, { robot }) {
    this.ended();
    if (!answer.broken) this.problem("");
    for (const place of ["options", "regions"]) say(byId(`${place}-problem`), "", true);
    if (answer.refusal) say(byId(`${answer.about ?? "path"}-problem`), answer.refusal, true);
    this.refused = Boolean(answer.refusal);
    this.hint();
    byId("saves").querySelectorAll("button").forEach((button) => (button.disabled = this.refused));
    if (answer.refusal) {
      say(byId("message"), this.plan ? "Picture and numbers are those of the last plan that could be made." : "");
      this.show();
      return;
    }
    const again = this.plannedFor === this.state;
    this.plan = shown(answer.answer, robot);
    this.plannedFor = this.state;
    this.old = false;
    say(byId("message"), summary(this.plan));
    showResults(this.plan, byId("tails").checked);
    this.showStrip();
    this.player.take(this.plan, again);
    this.show();
    if (this.track) this.compare();
    if (byId("trade").open) this.tradeOff();
  }

  /* Draw a chart, now and when the window has another width. */
  draw(name, chart) {
    this.charts.set(name, chart);
    chart();
  }

  /* Show the dwells over time. */
  showStrip() {
    const { dwells } = this.plan, content = { times: runningSum(dwells), values: [...dwells], words: "dwell [s]", steps: true };
    this.draw("strip", () => {
      this.scale = chart(byId("strip"), content);
      this.player.show();
    });
  }

  problem(words) {
    say(byId("problem"), words, true);
  }

  show() {
    const tracks = this.track ? [{ points: this.track.points }] : [];
    this.view.show({ drawn: this.drawn ?? null, plan: this.plan, tracks, old: this.old && this.plan !== null });
  }

  played(pose, time) {
    this.view.playing = this.player.running;
    this.view.showRobot(this.plan.body, pose);
    if (this.scale) marker(byId("strip"), this.scale.x(time));
  }

  setRobot(values, key) {
    const { name } = this.state.robot, isNew = this.robots.has(name) && !name.endsWith("-changed");
    this.change({ robot: { name: isNew ? `${name}-changed` : name, values } }, `robot ${key}`);
  }

  /* Take points; those drawn here are put on the grid, those of a file are not. */
  setPoints(points, closed, name = "my path", grid = onGrid(points)) {
    const refusal = pointsRefusal(grid);
    say(byId("path-problem"), refusal, true);
    if (refusal) return;
    this.editor.take({ points, closed });
    this.change({ path: { points: grid, closed, name } });
  }

  /* Take the outline of a region, or of the walls. */
  enclose(points, kind) {
    const words = `polygon:${onGrid(points).flat().join(",")}`, before = kind === "walls" ? "" : this.state.options.keepOut;
    this.setOption(kind, `${before} ${words}`.trim());
  }

  /* Smooth a stroke, or the path that is shown, and make it the path. */
  async smooth(points, closed, name) {
    const over = this.state.options.smooth;
    await this.ask("smooth", { points, closed, over }, ({ answer, refusal }) => {
      say(byId("path-problem"), refusal ?? "", true);
      if (refusal) return;
      byId("smooth").placeholder = answer.over;
      this.view.moved = true;
      this.setPoints(answer.points, closed, name);
    });
  }

  async tradeOff() {
    byId("trade-off").replaceChildren();
    this.charts.delete("trade-off");
    say(byId("trade-words"), "Planning with ten dwells…");
    const { answer, refusal, stopped } = await this.client.ask("tradeOff", this.wish());
    if (stopped) return;
    say(byId("trade-words"), refusal ?? "", true);
    const take = (dwell) => this.setOption("minimumSeconds", dwell);
    const draw = () => tradeOff(byId("trade-off"), answer, this.state.options.minimumSeconds, take);
    if (answer) this.draw("trade-off", draw);
  }

  setOption(key, value) {
    this.change({ options: { ...this.state.options, [key]: value } });
  }

  async saveFile(name) {
    if (name === "plan.svg") {
      const style = document.querySelector("style").textContent;
      save(name, pictureText(byId("view"), document.title, style), "image/svg+xml");
      return;
    }
    const answer = await this.client.ask("file", { name, wish: this.wish() });
    say(byId("take-problem"), answer.refusal ?? "", true);
    if (!answer.refusal) save(name, answer.answer);
  }

  /* Open the file that was dropped or chosen; it says by its content what it is. */
  async openFiles(files) {
    this.count(1);
    const file = await oneFile(files);
    if (file?.refusal) this.fileProblem.tell("path", file.refusal);
    else if (file) {
      const part = /\.toml$/i.test(file.name) ? "robot" : "path";
      await this.ask("open", file, async ({ answer, refusal }) => {
        this.fileProblem.tell(part, refusal ?? "");
        if (!refusal) await this.opened(file.name, answer);
      });
    }
    this.fileProblem.place?.scrollIntoView({ block: "nearest" });
    this.count(-1);
  }

  async opened(name, content) {
    if (content.kind === "robot" && this.data.locked) {
      const command = `softflagella page --robot ${name} --out page.html`;
      this.fileProblem.tell("robot", `this page plans for ${this.data.locked.name} alone; make a page of ${name}: ${command}`);
    } else if (content.kind === "robot") {
      this.robots.set(content.fields.name, content);
      this.change({ robot: { name: content.fields.name, values: labValues(content.fields) } });
    } else if (content.kind === "path") {
      const scales = { [this.measured ? "mean turn radii" : "tail lengths"]: this.plan?.tailLength ?? 10 };
      const path = await askUnit(content, scales);
      if (path) {
        this.view.moved = false;
        this.setPoints(path.points, path.closed, path.name, path.points);
      }
    } else if (content.kind === "track") {
      await this.compare("none", { name, ...content });
    } else if (content.kind === "runs") {
      await this.runs.open(name, content.table, this.wish().robot);
      byId("measured-title").scrollIntoView();
    }
  }

  async compare(how = this.track.how, track = this.track) {
    await this.ask("compare", { table: track.table, how }, ({ answer, refusal }) => {
      this.fileProblem.tell("measured", refusal ? `${track.name}: ${refusal}` : "");
      if (refusal && this.track?.table === track.table) this.removeTrack();
      if (refusal) return;
      this.track = { ...track, ...answer, how };
      this.view.moved = false;
      this.show();
      this.showTrack();
    });
  }

  showTrack() {
    const drawErrors = showTrack(this.track, this.plan, byId("tails").checked, {
      fit: (wished) => this.compare(wished),
      saveTrack: () => save("track.csv", this.track.csv, "text/csv"),
      remove: () => this.removeTrack(),
    });
    this.draw("track", drawErrors);
  }

  removeTrack() {
    this.track = null;
    byId("measured").replaceChildren();
    this.charts.delete("track");
    this.show();
  }

  newAddress() {
    const { state, problem } = this.address();
    this.change(state);
    this.linkProblem.tell("path", problem);
  }

  /* Undo (-1) or redo (1) a change. */
  step(way) {
    this.history.move(way);
    this.refresh();
  }

  /* Whether what most people do next is to take the schedule of their path along. */
  get saves() {
    return Boolean(this.state.path.points) && !this.refused;
  }

  /* Say what the pointer does, and offer what most people do next. */
  hint() {
    say(byId("mode-words"), this.editor.words);
    const draw = this.editor.mode === "draw" ? "Draw in the picture" : "Draw your own path";
    byId("next").textContent = this.saves ? "Save the schedule" : draw;
  }

  mode(name, anew = false) {
    this.editor.use(name, anew);
    byId("view").dataset.mode = name;
    this.hint();
    this.view.place();
  }
}

/* A plan with what the picture needs besides the planner's numbers; robot: its fields. */
function shown(plan, robot) {
  const { motion, samples, offset, dwells, warnings } = plan, cm = (length) => 100 * length;
  const track = motion.map(([x, y, heading]) => [x + offset * Math.cos(heading), y + offset * Math.sin(heading)]);
  return {
    ...plan, track, flips: track.filter((_, i) => i % samples === 0), start: motion[0], seconds: sum(dwells),
    warnings: warnings.map((words) => inPage(words, robot)),
    tailLength: cm(robot.tailLength),
    body: robot.measured ? bodyOf(robot) : {
      headLength: cm(robot.headLength), headRadius: cm(robot.headRadius), tailLength: cm(robot.tailLength),
      tailRadius: cm(robot.tailRadius), discOffset: cm(robot.discOffset ?? robot.headRadius), tails: robot.tails,
    },
  };
}

/* What the picture draws of a measured vehicle: its body; a slim mark where it has no size. */
function bodyOf({ measured, tailLength }) {
  const { length_m: long, width_m: wide } = Object.fromEntries(measured);
  const headLength = 100 * (long || wide || MARK * tailLength);
  return { headLength, headRadius: wide ? 50 * wide : headLength / 6, tails: 0 };
}

async function begin() {
  const data = JSON.parse(byId("data").textContent), packed = [byId("planner").textContent.trim(), data.first.plan];
  const [planner, plan] = await Promise.all(packed.map((text) => text && inflated(text).text()));
  new Page(data, planner).start(JSON.parse(plan));
}

begin();
