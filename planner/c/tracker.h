/* ---- poses in, orders out ------------------------------------------------------------------------------------ */

static void tracker_plan_flip(tracker *t)
{
    tracker_begin_of_dwell from = {{t->state[0], t->state[1], t->state[2]}, t->dwell.before, t->dwell.sense};
    tracker_where where = t->where;
    tracker_real present[3], elapsed = tracker_larger((tracker_real)(t->now - t->dwell.start), 0);
    double start = t->dwell.start, least;
    tracker_apply(t);
    for (int i = 0; i < 3; i++) present[i] = from.pose[i];
    if (elapsed > 0) tracker_moved(t, &from, elapsed, present);
    if (tracker_is_off(t, present)) {
        tracker_plan_way(t, present);
        where = t->where;
    }
    t->where = where;
    t->flip_at = start + tracker_next(t, &from, elapsed, &t->ends);
    t->where = where;
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
    tracker_advance_moved(t, &done);
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
    tracker_real seen[3], left[3], H[3][TRACKER_STATES], size;
    if (!tracker_seen_from(t, when, seen, H)) return 0;
    tracker_difference(pose, seen, left);
    size = tracker_update(t, left, H);
    if (size <= TRACKER_GATE) {
        t->rejected = 0;
        tracker_forget_moved(t);
        tracker_judge(t, size);
        return 1;
    }
    t->rejected++;
    if (t->rejected >= TRACKER_LOST) t->alarm = 1;
    if (!tracker_see_moved(t, pose, when)) return 0;
    tracker_relocate(t, t->moved.pose);
    tracker_forget_moved(t);
    t->rejected = t->scored = 0;
    t->score = 0;
    return 1;
}

/* Bounds the distance of the tracked point from the path until the next flip: uniform between its values now and at
 * the flip, plus a normal error. */
static tracker_real tracker_bound(tracker *t)
{
    tracker_real D[3][TRACKER_STATES], pose[3], ends[2], spread = 0, direction, g[TRACKER_STATES], row, lever;
    tracker_where where = t->where;
    tracker_change change;
    for (int end = 0; end < 2; end++) {
        double when = end == 0 ? t->now : t->flip_at;
        if (when < t->dwell.start) when = t->dwell.start;
        tracker_change_of(t, t->state[2], &t->dwell, (tracker_real)(when - t->dwell.start), &change);
        for (int i = 0; i < 3; i++) pose[i] = t->state[i] + change.move[i];
        tracker_identity(D);
        tracker_through(D, &change, 0);
        ends[end] = tracker_distance(t, pose, &direction);
        t->where = where;
        lever = TRACKER_OFFSET * TRACKER_SIN(direction - pose[2]);
        for (int k = 0; k < TRACKER_STATES; k++)
            g[k] = TRACKER_COS(direction) * D[0][k] + TRACKER_SIN(direction) * D[1][k] + lever * D[2][k];
        spread = 0;
        for (int i = 0; i < TRACKER_STATES; i++) {
            row = tracker_dot(t->covariance[i], g);
            spread += row * g[i];
        }
    }
    tracker_real middle = TRACKER_FABS(ends[0] + ends[1]) / 2, uniform = (ends[0] - ends[1]) * (ends[0] - ends[1]) / 12;
    tracker_real variance = uniform + TRACKER_SPREADS * TRACKER_SPREADS * tracker_larger(spread, 0);
    tracker_real share = uniform / tracker_larger(variance, (tracker_real)1e-30), deviation = TRACKER_SQRT(variance);
    share *= share * share;
    tracker_real within = TRACKER_WITHIN_NORMAL + share * (TRACKER_WITHIN_UNIFORM - TRACKER_WITHIN_NORMAL);
    tracker_real below = TRACKER_BELOW_NORMAL + share * (TRACKER_BELOW_UNIFORM - TRACKER_BELOW_NORMAL);
    return tracker_larger(within * deviation, middle + below * deviation);
}

/* The same answer again. */
static inline tracker_advice tracker_answer(const tracker *t)
{
    tracker_advice advice;
    advice.direction = t->finished ? 0 : t->dwell.sense;
    advice.flip_at = t->flip_at * TRACKER_TIME_SCALE;
    advice.finished = t->finished;
    advice.alarm = t->alarm;
    advice.error = t->bound;
    return advice;
}

/* The robot is at rest at `start`, from where the tracker plans the way to the path, or if that is 0 at the plan's
 * start, and the motor starts at `begin` [s]. Noise is one standard deviation of a pose: of x and y [tail lengths],
 * of the heading [rad]. */
static inline void tracker_begin_at(tracker *t, tracker_real noise, tracker_real noise_heading, double begin,
                                    const tracker_real *start)
{
    memset(t, 0, sizeof *t);
    for (int i = 0; i < 3; i++) t->state[i] = tracker_start[i];
    for (int i = 0; i < TRACKER_STATES; i++)
        for (int j = 0; j < TRACKER_STATES; j++) t->covariance[i][j] = TRACKER_REAL(tracker_prior, i * TRACKER_STATES + j);
    t->noise[0] = t->noise[1] = noise * noise;
    t->noise[2] = noise_heading * noise_heading;
    if (start) tracker_relocate(t, start);
    t->latest = TRACKER_KEPT - 1;
    t->where.leg = TRACKER_SEGMENTS;
    t->last = TRACKER_POINTS - 2;
    t->around = TRACKER_LAP > 0;
    t->now = t->dwell.start = t->flip_at = begin / TRACKER_TIME_SCALE;
    t->dwell.before = -1;
    t->dwell.sense = TRACKER_FIRST_DIRECTION;
    tracker_plan_flip(t);
    if (tracker_first_turn(t) == -t->dwell.sense) {
        t->dwell.sense = -t->dwell.sense;
        tracker_plan_flip(t);
    }
    t->bound = tracker_bound(t);
}

/* The robot is at rest at the plan's start. */
static inline void tracker_begin(tracker *t, tracker_real noise, tracker_real noise_heading, double begin)
{
    tracker_begin_at(t, noise, noise_heading, begin, 0);
}

/* Ends a path that repeats at the end of this lap. */
static inline tracker_advice tracker_finish_lap(tracker *t)
{
    t->stopping = TRACKER_LAP > 0;
    tracker_go_around(t);
    if (!t->finished) tracker_plan_flip(t);
    t->bound = tracker_bound(t);
    return tracker_answer(t);
}

/* Tell the time [s], and a pose if there is one (else 0) with the time at which it was true [s]. A time that is not
 * finite, goes back or jumps too far is taken for the last one, until it is confirmed twice. */
static inline tracker_advice tracker_feed(tracker *t, double now, const tracker_real *pose, double seen)
{
    seen /= TRACKER_TIME_SCALE;
    tracker_tell(t, now / TRACKER_TIME_SCALE);
    if (!t->finished && t->now >= t->flip_at - TRACKER_SLACK) tracker_flip(t);
    if (pose && !t->finished && t->believed && isfinite(pose[0]) && isfinite(pose[1]) && isfinite(pose[2]) &&
        isfinite(seen) && seen <= t->now && tracker_see(t, pose, seen))
        tracker_plan_flip(t);
    t->bound = tracker_bound(t);
    return tracker_answer(t);
}
