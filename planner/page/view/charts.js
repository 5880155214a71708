/* Small charts: dwells over time, and error over time of a measured track. Drawn in pixels. */
import { largest } from "../math.js";
import { digits, duration, figure } from "./dom.js";
import { lineData } from "./scene.js";

const EDGE = { left: 46, right: 10, top: 18, bottom: 18 };

/* Draw values over time as a line; `steps` holds each value until the next time. Return the pixel of a time. */
function chart(svg, { times, values, words, limit = null, steps = false }) {
  const width = svg.clientWidth || 600, height = svg.clientHeight || 64;
  const first = times[0], span = Math.max(times[times.length - 1] - first, 1e-12);
  const high = Math.max(limit ?? 0, largest(values)) || 1;
  const x = (time) => EDGE.left + ((width - EDGE.left - EDGE.right) * (time - first)) / span;
  const y = (value) => height - EDGE.bottom - ((height - EDGE.top - EDGE.bottom) * value) / high;
  const points = steps
    ? values.flatMap((value, i) => [[x(times[i]), y(value)], [x(times[i + 1]), y(value)]])
    : values.map((value, i) => [x(times[i]), y(value)]);
  const text = (left, down, anchor, said) => figure("text", { x: left, y: down, "text-anchor": anchor }, said);
  const level = (kind, value, dashes = "none") => {
    return figure("path", { class: kind, d: `M${EDGE.left},${y(value)}H${width - EDGE.right}`, "stroke-dasharray": dashes });
  };
  svg.replaceChildren(
    level("grid", 0), level("grid", high),
    figure("path", { class: "curve", d: lineData(points) }),
    text(EDGE.left - 4, y(high) + 4, "end", digits(high, 2)), text(EDGE.left - 4, y(0) + 4, "end", "0"),
    text(EDGE.left, 12, "start", words), text(EDGE.left, height - 4, "start", duration(first)),
    text((EDGE.left + width - EDGE.right) / 2, height - 4, "middle", "time"),
    text(width - EDGE.right, height - 4, "end", duration(times[times.length - 1])),
    ...(limit === null ? [] : [level("now", limit, "5 4")]),
  );
  return x;
}

/* The line that marks a time in a chart of this height. */
function marker(svg, x) {
  svg.querySelector(".time")?.remove();
  svg.append(
    figure("path", { class: "now time", d: `M${x},${EDGE.top}V${(svg.clientHeight || 64) - EDGE.bottom}` }),
  );
}

/* Draw stated error over time for several dwells; `take(dwell)` is called with the one that is chosen. */
function tradeOff(rows, chosen, take) {
  const width = 320, height = 190;
  const about = { viewBox: `0 0 ${width} ${height}`, role: "group", "aria-label": "Stated error over time" };
  const minutes = rows.map((row) => row.seconds / 60), errors = rows.map((row) => row.stated);
  const high = Math.max(...minutes) * 1.05, most = Math.max(...errors) * 1.1;
  const x = (value) => 44 + ((width - 60) * value) / high, y = (value) => height - 34 - ((height - 50) * value) / most;
  const svg = figure(
    "svg", about,
    figure("path", { class: "grid", d: `M44,${y(0)}H${width - 16}M44,${y(0)}V${y(most)}` }),
    figure("path", { class: "curve", d: lineData(rows.map((_, i) => [x(minutes[i]), y(errors[i])])) }),
    figure("text", { x: width - 16, y: height - 6, "text-anchor": "end" }, "time [min]"),
    figure("text", { x: 4, y: 12 }, "stated error [cm]"),
    figure("text", { x: x(high), y: height - 20, "text-anchor": "end" }, digits(high, 2)),
    figure("text", { x: 40, y: y(most) + 14, "text-anchor": "end" }, digits(most, 2)),
  );
  rows.forEach((row, i) => {
    const words = `dwell ${digits(row.dwell)} s: ${digits(minutes[i])} min, ${digits(errors[i])} cm`;
    const choose = () => take(row.dwell);
    const key = (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      choose();
    };
    const dot = {
      class: "dot", cx: x(minutes[i]), cy: y(errors[i]), r: row.dwell === chosen ? 8 : 6, tabindex: 0, role: "button",
      "aria-label": words, click: choose, keydown: key,
    };
    svg.append(figure("circle", dot, figure("title", {}, words)));
  });
  return svg;
}

export { chart, marker, tradeOff };
