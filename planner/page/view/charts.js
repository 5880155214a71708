/* Small charts: dwells over time, and error over time of a measured track. Drawn in pixels. */
import { largest, smallest } from "../math.js";
import { digits, duration, figure } from "./dom.js";
import { lineData } from "./scene.js";

const EDGE = { left: 46, right: 10, top: 18, bottom: 18 };

/* Draw values over time [s] as a line; `steps` holds each value until the next time. Return the pixels of a time and
 * of a value. */
function chart(svg, { times, values, words, limit = null, steps = false }) {
  const width = svg.clientWidth || 600, height = svg.clientHeight || 64, { left, top } = EDGE;
  const right = width - EDGE.right, low = height - EDGE.bottom, first = smallest(times), last = largest(times);
  const high = Math.max(limit ?? 0, largest(values)) || 1;
  const x = (time) => left + ((right - left) * (time - first)) / Math.max(last - first, 1e-12);
  const y = (value) => low - ((low - top) * value) / high;
  const points = values.flatMap((value, i) => {
    return (steps ? [times[i], times[i + 1]] : [times[i]]).map((time) => [x(time), y(value)]);
  });
  const text = (at, down, anchor, said) => figure("text", { x: at, y: down, "text-anchor": anchor }, said);
  const level = (kind, value, dashes = "none") => {
    return figure("path", { class: kind, d: `M${left},${y(value)}H${right}`, "stroke-dasharray": dashes });
  };
  svg.replaceChildren(
    level("grid", 0), level("grid", high), figure("path", { class: "curve", d: lineData(points) }),
    text(left - 4, y(high) + 4, "end", digits(high, 2)), text(left - 4, y(0) + 4, "end", "0"),
    text(left, top - 6, "start", words), text(left, height - 4, "start", duration(first)),
    text((left + right) / 2, height - 4, "middle", "time"), text(right, height - 4, "end", duration(last)),
    ...(limit === null ? [] : [level("now", limit, "5 4")]),
  );
  return { x, y };
}

/* The line that marks a time in a chart of this height. */
function marker(svg, x) {
  svg.querySelector(".time")?.remove();
  svg.append(figure("path", { class: "now time", d: `M${x},${EDGE.top}V${(svg.clientHeight || 64) - EDGE.bottom}` }));
}

/* Draw stated error over time for several dwells; `take(dwell)` is called with the one that is chosen. */
function tradeOff(svg, rows, chosen, take) {
  const times = rows.map(({ seconds }) => seconds), values = rows.map(({ stated }) => stated);
  const { x, y } = chart(svg, { times, values, words: "stated error [cm]" });
  svg.append(...rows.map(({ dwell, seconds, stated }) => {
    const words = `dwell ${digits(dwell)} s: ${duration(seconds)}, ${digits(stated)} cm`;
    const key = (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      take(dwell);
    };
    const dot = {
      class: "dot", cx: x(seconds), cy: y(stated), r: dwell === chosen ? 8 : 6, tabindex: 0, role: "button",
      "aria-label": words, click: () => take(dwell), keydown: key,
    };
    return figure("circle", dot, figure("title", {}, words));
  }));
}

export { chart, marker, tradeOff };
