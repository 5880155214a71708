/* Feeds patterns with texts: standard input is [[source, flags, [[lead, unit, end], …]], …], the arguments are sizes.
 * Prints the patterns whose time grows faster than the length of a text. */
import { readFileSync } from "node:fs";

const [steep, idle, ...sizes] = process.argv.slice(2).map(Number);

function seconds(pattern, text) {
  const began = performance.now();
  text.replace(pattern, "");
  return (performance.now() - began) / 1000;
}

function slow(pattern, [lead, unit, end]) {
  let before = idle;
  for (const size of sizes) {
    const text = lead + unit.repeat(size / unit.length) + end;
    let least = seconds(pattern, text);
    for (let again = 0; again < 2 && least > steep * before; again++) least = Math.min(least, seconds(pattern, text));
    if (least > steep * before) return true;
    before = Math.max(least, idle);
  }
  return false;
}

for (const [source, flags, texts] of JSON.parse(readFileSync(0, "utf8"))) {
  const pattern = new RegExp(source, flags), text = texts.find((each) => slow(pattern, each));
  if (text) console.log(`/${source}/${flags} ${JSON.stringify(text)}`);
}
