/* What a plan tells while it is made.
 *
 * Mirrors planner/planning/progress.py. Progress is a function of the stage, in words, and the share of it that is
 * done, or null. */

const DECLARING = "finding the nearest path that can be followed";
const REMEDY = "too tight: looking for a change that helps";
const FOLLOWING = "following the path";

/* Tell how far a stage is. */
function tell(progress, stage, done) {
  if (progress) progress(stage, done);
}

export { DECLARING, REMEDY, FOLLOWING, tell };
