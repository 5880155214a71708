/* The known word that is nearest to a misspelt one.
 *
 * Stands for difflib.get_close_matches in sim/model/robot_toml.py: likeness is twice the number of letters in
 * common blocks over the letters of both words, the longest block first. */

/* The word most like a given one, of at least this likeness; null if there is none. */
function closeMatch(word, known, least = 0.6) {
  let best = null, most = least;
  for (const other of known) {
    const alike = word.length + other.length ? (2 * common(other, word)) / (word.length + other.length) : 1;
    if (alike > most || (alike === most && (best === null || other > best))) [best, most] = [other, alike];
  }
  return best;
}

/* The number of letters in common blocks. */
function common(first, second) {
  let length = 0, at = 0, other = 0;
  for (let i = 0; i < first.length; i++) {
    for (let j = 0; j < second.length; j++) {
      let count = 0;
      while (i + count < first.length && first[i + count] === second[j + count]) count++;
      if (count > length) [length, at, other] = [count, i, j];
    }
  }
  if (!length) return 0;
  const before = common(first.slice(0, at), second.slice(0, other));
  return before + length + common(first.slice(at + length), second.slice(other + length));
}

export { closeMatch };
