/* ---- poses in, orders out ------------------------------------------------------------------------------------ */

static void tracker_plan_flip(tracker *t)
{
    tracker_begin_of_dwell from = {{t->state[0], t->state[1], t->state[2]}, t->dwell.before, t->dwell.sense};
    int place = t->place;
    double start = t->dwell.start, least;
    tracker_apply(t);
    t->flip_at = start + tracker_next(t, &from, &t->ends);
    t->place = place;
    least = t->ends ? start : start + TRACKER_SHORTEST;
    if (t->flip_at < t->now) t->flip_at = t->now;
    if (t->flip_at < least) t->flip_at = least;
}

static void tracker_flip(tracker *t)
{
    tracker_dwell done = t->dwell;
    if (t->ends) {
        t->finished = 1;
        return;
    }
    done.length = (tracker_real)(t->flip_at - done.start);
    tracker_advance(t, &done);
    tracker_apply(t);
    tracker_learn(t, done.sense);
    t->latest = (t->latest + 1) % TRACKER_KEPT;
    t->past[t->latest] = done;
    if (t->kept < TRACKER_KEPT) t->kept++;
    t->dwell.start = t->flip_at;
    t->dwell.before = done.length;
    t->dwell.sense = -done.sense;
    tracker_plan_flip(t);
    t->finished = t->ends && t->flip_at <= t->now + TRACKER_SLACK; /* the path ends at the flip */
}

static void tracker_judge(tracker *t, tracker_real size)
{
    t->score += size;
    t->scored++;
    if (t->scored == TRACKER_WINDOW) {
        t->alarm = t->score > TRACKER_ALARM_AT;
        t->score = 0;
        t->scored = 0;
    }
}

/* 1 if something was learned from the pose. */
static int tracker_see(tracker *t, const tracker_real pose[3], double when)
{
    tracker_real left[3], H[3][TRACKER_STATES], size;
    if (!tracker_seen_from(t, when, left, H)) return 0;
    for (int i = 0; i < 3; i++) left[i] = pose[i] - left[i];
    left[2] -= 2 * TRACKER_PI * TRACKER_FLOOR((left[2] + TRACKER_PI) / (2 * TRACKER_PI));
    size = tracker_update(t, left, H);
    if (size <= TRACKER_GATE) {
        t->rejected = 0;
        tracker_judge(t, size);
        return 1;
    }
    t->rejected++;
    if (t->rejected >= TRACKER_LOST) { /* many in a row: it is the estimate that is wrong */
        t->rejected = 0;
        t->alarm = 1;
        for (int i = 0; i < 3; i++) t->covariance[i][i] += TRACKER_DISPLACED * TRACKER_DISPLACED;
    }
    return 0;
}

/* The same answer again. */
static inline tracker_advice tracker_answer(const tracker *t)
{
    tracker_real spread = tracker_larger(t->covariance[0][0] + t->covariance[1][1], 0) / 2;
    tracker_advice advice;
    advice.direction = t->finished ? 0 : t->dwell.sense;
    advice.flip_at = t->flip_at * TRACKER_TIME_SCALE;
    advice.finished = t->finished;
    advice.alarm = t->alarm;
    advice.error = TRACKER_SWING_ERROR + TRACKER_QUANTILE * TRACKER_SQRT(spread);
    return advice;
}

/* The robot is at rest at the plan's start, and the motor starts at `begin` [s]. Noise is one standard deviation of
 * a pose: of x and y [tail lengths], of the heading [rad]. */
static inline void tracker_begin(tracker *t, tracker_real noise, tracker_real noise_heading, double begin)
{
    memset(t, 0, sizeof *t);
    for (int i = 0; i < 3; i++) t->state[i] = tracker_start[i];
    for (int i = 0; i < TRACKER_STATES; i++)
        for (int j = 0; j < TRACKER_STATES; j++) t->covariance[i][j] = TRACKER_REAL(tracker_prior, i * TRACKER_STATES + j);
    t->noise[0] = t->noise[1] = noise * noise;
    t->noise[2] = noise_heading * noise_heading;
    t->latest = TRACKER_KEPT - 1;
    t->now = t->dwell.start = begin / TRACKER_TIME_SCALE;
    t->dwell.before = -1;
    t->dwell.sense = TRACKER_FIRST_DIRECTION;
    tracker_plan_flip(t);
}

/* Tell the time [s], and a pose if there is one (else 0) with the time at which it was true [s]. A time that goes
 * back, jumps too far or is not finite is taken for the last one. */
static inline tracker_advice tracker_feed(tracker *t, double now, const tracker_real *pose, double seen)
{
    now /= TRACKER_TIME_SCALE;
    seen /= TRACKER_TIME_SCALE;
    if (t->now < now && now < t->now + TRACKER_LONGEST_GAP) t->now = now;
    if (!t->finished && t->now >= t->flip_at - TRACKER_SLACK) tracker_flip(t);
    if (pose && !t->finished && isfinite(pose[0]) && isfinite(pose[1]) && isfinite(pose[2]) && isfinite(seen) &&
        seen <= t->now && tracker_see(t, pose, seen))
        tracker_plan_flip(t);
    return tracker_answer(t);
}
