/* Numbers as the command line writes them, for readers: lengths in cm, times in s, min or h. */

const LEAST = 0.001; // cm: the grid of points

/* A number to three digits, without an exponent where that is readable. */
function digits(value, count = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(count - 1).replace("-", "−");
  const places = Math.max(0, count - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 8)).replace("-", "−");
}

function duration(seconds) {
  if (seconds < 90) return `${digits(seconds)} s`;
  if (seconds < 5400) return `${digits(seconds / 60)} min`;
  return `${digits(seconds / 3600)} h`;
}

/* Minutes and seconds of a clock: 3:07.5 */
function clock(seconds) {
  const tenths = Math.round(10 * seconds);
  return `${Math.floor(tenths / 600)}:${((tenths % 600) / 10).toFixed(1).padStart(4, "0")}`;
}

function degrees(radians) {
  return digits((radians * 180) / Math.PI);
}

/* A length in cm; with `tails`, in tail lengths behind it. */
function length(centimetres, tailLength, tails) {
  if (centimetres < LEAST) return `below ${LEAST} cm`;
  return tails ? `${digits(centimetres)} cm (${digits(centimetres / tailLength)} l)` : `${digits(centimetres)} cm`;
}

export { clock, degrees, digits, duration, length };
