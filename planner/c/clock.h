/* ---- the clock ----------------------------------------------------------------------------------------------- */

/* Hears the time. It is believed until somewhat after the next flip; others when they are confirmed: then the clock
 * was set, and all times move with it. */
static void tracker_tell(tracker *t, double now)
{
    double shift;
    t->believed = isfinite(now) && t->now - TRACKER_EARLY <= now && now <= t->flip_at + TRACKER_LATE;
    if (t->believed) {
        if (now > t->now) t->now = now;
        t->refused = 0;
        return;
    }
    if (!isfinite(now)) return;
    if (t->refused > 0 && t->refused_last < now && now <= t->refused_last + TRACKER_LATE) t->refused++;
    else {
        t->refused = 1;
        t->refused_first = now;
    }
    t->refused_last = now;
    if (t->refused < TRACKER_CONFIRMED) return;
    shift = t->refused_first - t->now; /* as if the first had come at once: no flip comes too early */
    t->now = now;
    t->believed = 1;
    t->refused = 0;
    t->flip_at += shift;
    t->dwell.start += shift;
    for (int i = 0; i < TRACKER_KEPT; i++) t->past[i].start += shift;
}
