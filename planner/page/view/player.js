/* Playing a plan: time, speed, the robot's pose, the state of its motor. Lengths in cm, times in s. */
import { clip, indexBelow, runningSum } from "../math.js";
import { byId, clock, element } from "./dom.js";

const SPEEDS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const WISHED = 40; // seconds that the whole plan takes at the first speed

class Player {
  /* `moved(pose, time)` is told of each pose. */
  constructor(moved) {
    this.moved = moved;
    this.plan = null;
    this.running = false;
    byId("speed").append(...SPEEDS.map((speed) => element("option", { value: speed }, `${speed} ×`)));
    byId("play").addEventListener("click", () => this.toggle(!this.running));
    byId("time").addEventListener("input", () => this.show());
  }

  /* Take a plan. The time goes back to its start, unless it is the same plan again; the first plan starts by itself
   * unless less motion is wanted. */
  take(plan, again) {
    const first = this.plan === null;
    this.plan = plan;
    this.ends = runningSum(plan.dwells);
    byId("time").max = this.end;
    if (!again) byId("time").value = 0;
    if (first) {
      byId("speed").value = SPEEDS.find((speed) => this.end / speed <= WISHED) ?? SPEEDS[SPEEDS.length - 1];
      this.toggle(!matchMedia("(prefers-reduced-motion: reduce)").matches);
    }
    this.show();
  }

  get end() {
    return this.ends[this.ends.length - 1];
  }

  get time() {
    return Number(byId("time").value);
  }

  toggle(on) {
    if (!this.plan) return;
    this.running = on;
    byId("play").textContent = on ? "Pause" : "Play";
    byId("play").setAttribute("aria-pressed", String(on));
    if (!on) return;
    if (this.time >= this.end * (1 - 1e-9)) byId("time").value = 0;
    this.last = performance.now();
    requestAnimationFrame((now) => this.frame(now));
  }

  frame(now) {
    if (!this.running) return;
    const time = this.time + (Math.max(now - this.last, 0) / 1000) * Number(byId("speed").value);
    this.last = now;
    byId("time").value = Math.min(time, this.end);
    this.show();
    if (time >= this.end) this.toggle(false);
    else requestAnimationFrame((next) => this.frame(next));
  }

  show() {
    if (!this.plan) return;
    const { pose, dwell } = poseAt(this.plan, this.ends, this.time);
    const direction = dwell % 2 ? -this.plan.firstDirection : this.plan.firstDirection;
    const words = `${clock(this.time)} of ${clock(this.end)}, ${byId(direction > 0 ? "plus" : "minus").textContent}`;
    byId("clock").textContent = words;
    byId("time").setAttribute("aria-valuetext", words);
    this.moved(pose, this.time);
  }
}

/* The pose at a time, and the number of the dwell: linear between the samples of the track. */
function poseAt(plan, ends, time) {
  const low = clip(indexBelow(ends, time), 0, plan.dwells.length - 1);
  const share = clip((time - ends[low]) / plan.dwells[low], 0, 1) * plan.samples;
  const sample = Math.min(Math.floor(share), plan.samples - 1);
  const before = plan.motion[low * plan.samples + sample], after = plan.motion[low * plan.samples + sample + 1];
  const pose = before.map((value, k) => value + (share - sample) * (after[k] - value));
  return { pose, dwell: low };
}

export { Player, poseAt };
