/* ---- what is learned ----------------------------------------------------------------------------------------- */

static void tracker_change_of(const tracker *t, tracker_real heading, const tracker_dwell *dwell, tracker_real time,
                              tracker_change *out)
{
    const tracker_real *state = t->state;
    int sense = dwell->sense, side = sense > 0 ? 0 : 1;
    tracker_real lag[3], twist[3], along, across;
    tracker_lag_of(side, dwell->before, time, lag);
    tracker_learned(t, side, twist);
    tracker_real turned = lag[2] + sense * state[7], forward = twist[0], left = twist[1];
    tracker_real angle = tracker_arc(twist[2], time, &along, &across);
    tracker_real more = 1 + state[3 + side];
    tracker_real along_r = (time * TRACKER_COS(angle) - along) / more;
    tracker_real across_r = (time * TRACKER_SIN(angle) - across) / more;
    tracker_real ahead_r = along_r * forward - across_r * left, aside_r = across_r * forward + along_r * left;
    tracker_real c = TRACKER_COS(heading), s = TRACKER_SIN(heading);
    tracker_real lag_x = c * lag[0] - s * lag[1], lag_y = s * lag[0] + c * lag[1];
    c = TRACKER_COS(heading + turned);
    s = TRACKER_SIN(heading + turned);
    tracker_real surge_x = (c * along - s * across) * forward, surge_y = (s * along + c * across) * forward;
    tracker_real sway_x = -(c * across + s * along) * left, sway_y = (c * along - s * across) * left;
    tracker_real arc_x = surge_x + sway_x, arc_y = surge_y + sway_y, x = lag_x + arc_x, y = lag_y + arc_y;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < TRACKER_STATES; k++) out->slope[i][k] = 0;
    out->slope[0][3 + side] = c * ahead_r - s * aside_r;
    out->slope[1][3 + side] = s * ahead_r + c * aside_r;
    out->slope[2][3 + side] = angle / more;
    out->slope[0][5] = surge_x / (1 + state[5]);
    out->slope[1][5] = surge_y / (1 + state[5]);
    out->slope[0][6] = sway_x / (1 + state[6]);
    out->slope[1][6] = sway_y / (1 + state[6]);
    out->slope[0][7] = -sense * arc_y;
    out->slope[1][7] = sense * arc_x;
    out->slope[2][7] = (tracker_real)sense;
    out->slope[0][8] = out->slope[1][9] = time;
    out->lever[0] = -y;
    out->lever[1] = x;
    out->move[0] = x + (tracker_current[0] + state[8]) * time;
    out->move[1] = y + (tracker_current[1] + state[9]) * time;
    out->move[2] = turned + angle;
}

/* Derivatives of a pose after a change from those before it; with back = 1 the other way round. */
static void tracker_through(tracker_real D[3][TRACKER_STATES], const tracker_change *change, int back)
{
    for (int k = 0; k < TRACKER_STATES; k++) {
        if (back) D[2][k] -= change->slope[2][k];
        for (int i = 0; i < 2; i++) {
            if (back) D[i][k] = D[i][k] - change->slope[i][k] - change->lever[i] * D[2][k];
            else D[i][k] = D[i][k] + change->slope[i][k] + change->lever[i] * D[2][k];
        }
        if (!back) D[2][k] += change->slope[2][k];
    }
}

static void tracker_identity(tracker_real D[3][TRACKER_STATES])
{
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < TRACKER_STATES; k++) D[i][k] = i == k;
}

/* What is seen at the time `when` and its derivatives; 0 if it is too long ago. */
static int tracker_seen_from(const tracker *t, double when, tracker_real pose[3], tracker_real D[3][TRACKER_STATES])
{
    const tracker_dwell *dwell = &t->dwell;
    tracker_change change;
    int back = t->kept, at = t->latest;
    for (int i = 0; i < 3; i++) pose[i] = t->state[i];
    tracker_identity(D);
    while (when < dwell->start) {
        if (back == 0) return 0;
        back--;
        dwell = &t->past[at];
        at = at > 0 ? at - 1 : TRACKER_KEPT - 1;
        tracker_change_of(t, 0, dwell, dwell->length, &change);
        pose[2] -= change.move[2];
        tracker_change_of(t, pose[2], dwell, dwell->length, &change);
        pose[0] -= change.move[0];
        pose[1] -= change.move[1];
        tracker_through(D, &change, 1);
    }
    tracker_change_of(t, pose[2], dwell, (tracker_real)(when - dwell->start), &change);
    for (int i = 0; i < 3; i++) pose[i] += change.move[i];
    tracker_through(D, &change, 0);
    tracker_real c = TRACKER_COS(pose[2]), s = TRACKER_SIN(pose[2]);
    tracker_real marker_x = c * t->state[10] - s * t->state[11], marker_y = s * t->state[10] + c * t->state[11];
    for (int k = 0; k < TRACKER_STATES; k++) {
        D[0][k] -= marker_y * D[2][k];
        D[1][k] += marker_x * D[2][k];
    }
    D[0][10] += c;
    D[0][11] -= s;
    D[1][10] += s;
    D[1][11] += c;
    D[2][12] += 1;
    pose[0] += marker_x;
    pose[1] += marker_y;
    pose[2] += t->state[12];
    return 1;
}

/* One pose less another; the difference of the headings is between -pi and pi. */
static void tracker_difference(const tracker_real pose[3], const tracker_real expected[3], tracker_real left[3])
{
    for (int i = 0; i < 3; i++) left[i] = pose[i] - expected[i];
    left[2] -= 2 * TRACKER_PI * TRACKER_FLOOR((left[2] + TRACKER_PI) / (2 * TRACKER_PI));
}

/* Puts the robot at another pose, known like one of the marker; what was learned stays. */
static void tracker_relocate(tracker *t, const tracker_real pose[3])
{
    for (int i = 0; i < 3; i++) {
        t->state[i] = pose[i];
        for (int j = 0; j < TRACKER_STATES; j++) t->covariance[i][j] = t->covariance[j][i] = 0;
        t->covariance[i][i] = t->noise[i] + t->covariance[10 + i][10 + i];
    }
}

static void tracker_advance(tracker *t, const tracker_dwell *done)
{
    tracker_real F[3][TRACKER_STATES], half[3][TRACKER_STATES];
    tracker_change change;
    tracker_change_of(t, t->state[2], done, done->length, &change);
    tracker_identity(F);
    tracker_through(F, &change, 0);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < TRACKER_STATES; j++) {
            half[i][j] = 0;
            for (int k = 0; k < TRACKER_STATES; k++) half[i][j] += F[i][k] * t->covariance[k][j];
        }
    for (int i = 0; i < TRACKER_STATES; i++) {
        tracker_real *row = t->covariance[i], first[3];
        for (int j = 0; i < 3 && j < TRACKER_STATES; j++) row[j] = half[i][j];
        for (int j = 0; j < 3; j++) first[j] = tracker_dot(row, F[j]);
        for (int j = 0; j < 3; j++) row[j] = first[j];
    }
    for (int i = 0; i < 3; i++) {
        t->covariance[i][i] += TRACKER_WALK * TRACKER_WALK;
        t->state[i] += change.move[i];
    }
    for (int i = 0; i < 4; i++) t->covariance[3 + i][3 + i] += tracker_changes[i] * tracker_changes[i];
}

/* Learns from a pose and returns the squared size of what it differs; learns nothing if that is too large. */
static tracker_real tracker_update(tracker *t, const tracker_real left[3], tracker_real H[3][TRACKER_STATES])
{
    tracker_real P[TRACKER_STATES][TRACKER_STATES], moved[TRACKER_STATES] = {0}, gain[TRACKER_STATES], size = 0;
    for (int i = 0; i < TRACKER_STATES; i++)
        for (int j = 0; j < TRACKER_STATES; j++) P[i][j] = t->covariance[i][j];
    for (int m = 0; m < 3; m++) {
        for (int i = 0; i < TRACKER_STATES; i++) gain[i] = tracker_dot(P[i], H[m]);
        tracker_real spread = tracker_dot(H[m], gain) + t->noise[m], rest = left[m] - tracker_dot(H[m], moved);
        size += rest * rest / spread;
        for (int i = 0; i < TRACKER_STATES; i++) {
            moved[i] += gain[i] * rest / spread;
            for (int j = 0; j < TRACKER_STATES; j++) P[i][j] -= gain[i] * gain[j] / spread;
        }
    }
    if (!(size <= TRACKER_GATE)) return size;
    for (int i = 0; i < TRACKER_STATES; i++) {
        t->state[i] += moved[i];
        for (int j = 0; j < TRACKER_STATES; j++) t->covariance[i][j] = P[i][j];
    }
    for (int i = 0; i < TRACKER_STATES - 3; i++)
        t->state[3 + i] = tracker_smaller(tracker_larger(t->state[3 + i], -tracker_most[i]), tracker_most[i]);
    return size;
}
