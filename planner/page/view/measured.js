/* Measured tracks over the plan, with their errors. */

import { byId, describe, element, figure } from "./dom.js";
import { chart } from "./charts.js";
import { digits, duration, length } from "./words.js";

/* Show a track's errors; `actions` has fit(how), saveTrack() and remove(). */
function showTrack(track, plan, tails, actions) {
  const size = (value) => length(value, plan.tailLength, tails);
  const { error } = track;
  const [worstX, worstY] = error.worst.place;
  const list = element("dl");
  const within = error.largest <= error.stated;
  describe(list, [
    ["Track", `${track.name}${track.shift ? ` (moved: ${track.shift})` : ""}`],
    ...(track.ofPlan ? [["Of plan", `${track.ofPlan}, as the file says; compared with the plan above`]] : []),
    ["From the path to follow", `${size(error.rms)} rms, ${size(error.largest)} at most`],
    ["Stated error", `${size(error.stated)}: the track is ${within ? "within" : "above"} it`],
    ["From the drawn path", `${size(error.rawRms)} rms, ${size(error.rawLargest)} at most`],
    ["Largest error", `at ${duration(error.worst.time)}, x ${digits(worstX)} cm, y ${digits(worstY)} cm`],
  ]);
  const picture = figure("svg", {
    class: "chart", width: "100%", height: 90, role: "img", "aria-label": "Distance from the path over time",
  });
  const buttons = element(
    "div", { class: "row" },
    element("button", { type: "button", click: () => actions.fit("time") }, "Begin at time 0"),
    element("button", { type: "button", click: () => actions.fit("rigid") }, "Lay on the plan (rigid motion)"),
    element("button", { type: "button", click: () => actions.fit("none") }, "As measured"),
    element("button", { type: "button", click: actions.saveTrack }, "Save track.csv"),
    element("button", { type: "button", click: actions.remove }, "Remove"),
  );
  byId("measured").replaceChildren(list, picture, buttons);
  chart(picture, {
    times: error.times, values: error.distances, words: "distance from the path over time", unit: "cm",
    limit: error.stated,
  });
}

export { showTrack };
