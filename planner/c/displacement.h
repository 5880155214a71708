/* ---- rejected poses that agree: the robot was moved ---------------------------------------------------------- */

static void tracker_forget_moved(tracker *t)
{
    t->moved.agreed = t->moved.flips = t->moved.seen = 0;
    t->moved.score = 0;
}

static void tracker_advance_moved(tracker *t, const tracker_dwell *done)
{
    tracker_change change;
    if (t->moved.agreed == 0) return;
    tracker_change_of(t, t->moved.pose[2], done, done->length, &change);
    for (int i = 0; i < 3; i++) t->moved.pose[i] += change.move[i];
    t->moved.flips++;
}

/* What would be seen if the robot had been at `base` at the last flip. */
static int tracker_seen_from_base(tracker *t, double when, const tracker_real base[3], tracker_real pose[3])
{
    tracker_real own[3], D[3][TRACKER_STATES];
    int known;
    for (int i = 0; i < 3; i++) {
        own[i] = t->state[i];
        t->state[i] = base[i];
    }
    known = tracker_seen_from(t, when, pose, D);
    for (int i = 0; i < 3; i++) t->state[i] = own[i];
    return known;
}

/* Begins with one rejected pose: that at the last flip from which the robot would be seen there. */
static void tracker_begin_moved(tracker *t, const tracker_real pose[3], double when)
{
    tracker_real own[3] = {t->state[0], t->state[1], t->state[2]}, seen[3];
    tracker_forget_moved(t);
    if (!tracker_seen_from_base(t, when, own, seen)) return;
    tracker_real turn = pose[2] - seen[2], c = TRACKER_COS(turn), s = TRACKER_SIN(turn);
    tracker_real dx = own[0] - seen[0], dy = own[1] - seen[1];
    t->moved.pose[0] = pose[0] + c * dx - s * dy;
    t->moved.pose[1] = pose[1] + s * dx + c * dy;
    t->moved.pose[2] = own[2] + turn;
    t->moved.agreed = t->moved.seen = 1;
}

/* Compares a rejected pose with the others; 1 if the robot was moved to t->moved.pose. */
static int tracker_see_moved(tracker *t, const tracker_real pose[3], double when)
{
    tracker_real seen[3], left[3], size = 0;
    if (t->moved.agreed > 0) {
        if (!tracker_seen_from_base(t, when, t->moved.pose, seen)) return 0;
        tracker_difference(pose, seen, left);
        for (int i = 0; i < 3; i++)
            size += left[i] * left[i] / (2 * t->noise[i] + TRACKER_MODEL * TRACKER_MODEL);
        if (size <= TRACKER_LARGEST) {
            t->moved.agreed++;
            t->moved.seen++;
            t->moved.score += size;
            for (int i = 0; i < 3; i++) t->moved.pose[i] += left[i] / (tracker_real)t->moved.seen;
        } else {
            t->moved.agreed--;
        }
    }
    if (t->moved.agreed == 0) tracker_begin_moved(t, pose, when);
    if (t->moved.agreed < TRACKER_AGREED || t->moved.flips < TRACKER_FLIPS) return 0;
    if (t->moved.score <= TRACKER_MEAN * (tracker_real)t->moved.seen) return 1;
    tracker_begin_moved(t, pose, when);
    return 0;
}
