#ifdef TRACKER_FLOAT
#define TRACKER_SIN sinf
#define TRACKER_COS cosf
#define TRACKER_ATAN atanf
#define TRACKER_ATAN2 atan2f
#define TRACKER_ACOS acosf
#define TRACKER_SQRT sqrtf
#define TRACKER_FLOOR floorf
#define TRACKER_FABS fabsf
#else
#define TRACKER_SIN sin
#define TRACKER_COS cos
#define TRACKER_ATAN atan
#define TRACKER_ATAN2 atan2
#define TRACKER_ACOS acos
#define TRACKER_SQRT sqrt
#define TRACKER_FLOOR floor
#define TRACKER_FABS fabs
#endif
#define TRACKER_PI ((tracker_real)3.14159265358979323846)

typedef struct {
    int direction;      /* of the motor: 1 or -1; 0 at the end */
    double flip_at;     /* time of the next flip, or of the end [s] */
    int finished;
    int alarm;          /* 1: the robot behaves like no robot of this model: calibrate again */
    tracker_real error; /* the robot stays this close to the path until the next flip, in 95 % of the time [tail lengths] */
} tracker_advice;

typedef struct {
    double start;
    tracker_real before, length; /* before is negative for the first dwell */
    int sense;
} tracker_dwell;

typedef struct { /* an arc or a straight line of the way back */
    tracker_real x, y, course, curvature, length;
} tracker_segment;

typedef struct { /* place on path and way; the path follows the last segment */
    int place, leg;
    tracker_real share, along;
} tracker_where;

typedef struct { /* the second pose: where the robot is if it has been moved */
    tracker_real pose[3], score;
    int agreed, flips, seen;
} tracker_moved_robot;

typedef struct {
    /* pose at the last flip; yaw rates, surge, sway, lag angle, current, place and angle of the marker */
    tracker_real state[TRACKER_STATES];
    tracker_real covariance[TRACKER_STATES][TRACKER_STATES];
    tracker_real noise[3], score;
    tracker_dwell dwell, past[TRACKER_KEPT];
    int kept, latest; /* dwells in past; index of the latest one */
    double now, flip_at, refused_first, refused_last;
    int ends, finished, rejected, scored, alarm, refused, believed;
    tracker_real twist[2][3], lag_angle, current[2], drift[3]; /* the robot as it is learned */
    tracker_real error, last_error, bias, lean, turns, bound;
    tracker_where where;
    int reached, on_way, target;
    int last, around, stopping; /* last step of the path; whether it repeats; whether this lap is the last one */
    tracker_segment way[TRACKER_SEGMENTS];
    tracker_moved_robot moved;
} tracker;

typedef struct { /* what a time in a dwell adds to a pose */
    tracker_real move[3], lever[2], slope[3][TRACKER_STATES];
} tracker_change;

typedef struct {
    tracker_real pose[3], before;
    int sense;
} tracker_begin_of_dwell;

static tracker_real tracker_smaller(tracker_real a, tracker_real b) { return b < a ? b : a; }
static tracker_real tracker_larger(tracker_real a, tracker_real b) { return b > a ? b : a; }
static tracker_real tracker_dot(const tracker_real *a, const tracker_real *b)
{
    tracker_real sum = 0;
    for (int k = 0; k < TRACKER_STATES; k++) sum += a[k] * b[k];
    return sum;
}

/* ---- the robot's motion -------------------------------------------------------------------------------------- */

/* One number of the lag; knot -1: from rest. */
static tracker_real tracker_lag_entry(int side, int knot, int i, int part)
{
    int at = 3 * i + part, row = 3 * TRACKER_TIMES;
    if (knot < 0) return TRACKER_SHORT(tracker_rest, at + side * row) * tracker_lag_unit[part];
    at += knot * row;
    if (side == 0) return TRACKER_SHORT(tracker_lag_left, at) * tracker_lag_unit[part];
    return TRACKER_SHORT(tracker_lag_right, at) * tracker_lag_unit[part];
}

static tracker_real tracker_between(int side, int knot, int i, int part, tracker_real w)
{
    tracker_real low = tracker_lag_entry(side, knot, i, part), high = tracker_lag_entry(side, knot, i + 1, part);
    return low + w * (high - low);
}

static void tracker_lag_of(int side, tracker_real before, tracker_real time, tracker_real lag[3])
{
    tracker_real u = time / TRACKER_STEP, w = 1, part = 1;
    int i = TRACKER_TIMES - 2, k = TRACKER_KNOTS - 2;
    if (u < TRACKER_TIMES - 1) {
        i = (int)u;
        w = u - i;
    }
    if (before < 0) {
        for (int n = 0; n < 3; n++) lag[n] = tracker_between(side, -1, i, n, w);
        return;
    }
    if (before < TRACKER_REAL(tracker_knots, TRACKER_KNOTS - 1)) {
        tracker_real low, high;
        k = 0;
        while (before > TRACKER_REAL(tracker_knots, k + 1)) k++;
        low = TRACKER_REAL(tracker_knots, k);
        high = TRACKER_REAL(tracker_knots, k + 1);
        part = tracker_larger((before - low) / (high - low), 0);
    }
    for (int n = 0; n < 3; n++) {
        lag[n] = tracker_between(side, k, i, n, w);
        if (part != 0) lag[n] += part * (tracker_between(side, k + 1, i, n, w) - lag[n]);
    }
}

static tracker_real tracker_arc(tracker_real rate, tracker_real time, tracker_real *along, tracker_real *across)
{
    tracker_real angle = rate * time, half = TRACKER_SIN(angle / 2);
    *along = TRACKER_SIN(angle) / rate;
    *across = 2 * half * half / rate;
    return angle;
}

static void tracker_moved(const tracker *t, const tracker_begin_of_dwell *from, tracker_real time, tracker_real end[3])
{
    int side = from->sense > 0 ? 0 : 1;
    tracker_real lag[3], along, across;
    tracker_lag_of(side, from->before, time, lag);
    tracker_real turned = lag[2] + from->sense * t->lag_angle, forward = t->twist[side][0], left = t->twist[side][1];
    tracker_real angle = tracker_arc(t->twist[side][2], time, &along, &across);
    tracker_real ahead = along * forward - across * left, aside = across * forward + along * left;
    tracker_real c = TRACKER_COS(turned), s = TRACKER_SIN(turned);
    tracker_real z = lag[0] + c * ahead - s * aside, x = lag[1] + s * ahead + c * aside;
    c = TRACKER_COS(from->pose[2]);
    s = TRACKER_SIN(from->pose[2]);
    end[0] = from->pose[0] + c * z - s * x + t->current[0] * time;
    end[1] = from->pose[1] + s * z + c * x + t->current[1] * time;
    end[2] = from->pose[2] + turned + angle;
}

static void tracker_learned(const tracker *t, int side, tracker_real twist[3])
{
    twist[0] = tracker_twist[side][0] * (1 + t->state[5]);
    twist[1] = tracker_twist[side][1] * (1 + t->state[6]);
    twist[2] = tracker_twist[side][2] * (1 + t->state[3 + side]);
}

static tracker_real tracker_sideways(const tracker *t)
{
    tracker_real left = tracker_twist[0][1], fast = tracker_twist[0][2];
    tracker_real right = tracker_twist[1][1], slow = tracker_twist[1][2];
    tracker_real a = fast * (1 + t->state[3]), b = -slow * (1 + t->state[4]);
    tracker_real own = (b * left + a * right) * (1 + t->state[6]) / (a + b);
    return own - (-slow * left + fast * right) / (fast - slow);
}

static void tracker_apply(tracker *t)
{
    tracker_learned(t, 0, t->twist[0]);
    tracker_learned(t, 1, t->twist[1]);
    t->lag_angle = t->state[7];
    t->current[0] = tracker_current[0] + t->state[8];
    t->current[1] = tracker_current[1] + t->state[9];
    tracker_real speed = TRACKER_NET_SPEED * (1 + t->state[5]);
    t->drift[0] = (TRACKER_NET_DRIFT + tracker_sideways(t)) / speed;
    t->drift[1] = t->current[0] / speed;
    t->drift[2] = t->current[1] / speed;
}

/* ---- when to flip -------------------------------------------------------------------------------------------- */

static tracker_real tracker_step(int i, tracker_real *dx, tracker_real *dy)
{
    *dx = TRACKER_REAL(tracker_path_x, i + 1) - TRACKER_REAL(tracker_path_x, i);
    *dy = TRACKER_REAL(tracker_path_y, i + 1) - TRACKER_REAL(tracker_path_y, i);
    return *dx * *dx + *dy * *dy;
}

static tracker_real tracker_look(tracker *t, const tracker_real pose[3], int sense);
static tracker_real tracker_hysteresis(tracker_real curvature)
{
    return TRACKER_SWING * (1 + tracker_smaller(TRACKER_FABS(curvature) * TRACKER_PIVOT_RADIUS, 1)) / 2;
}

/* sigma (phi - phi_d) - h; moves the place to the nearest one */
static tracker_real tracker_look_at_path(tracker *t, const tracker_real pose[3], int sense)
{
    tracker_real c = TRACKER_COS(pose[2]), s = TRACKER_SIN(pose[2]);
    tracker_real heading = pose[2] - t->lean;
    tracker_real x = pose[0] + TRACKER_OFFSET * c, y = pose[1] + TRACKER_OFFSET * s;
    tracker_real dx, dy, away_x, away_y, square, share;
    int i = t->where.place, came = 0;
    x -= TRACKER_ROD * TRACKER_COS(heading);
    y -= TRACKER_ROD * TRACKER_SIN(heading);
    for (;;) {
        square = tracker_step(i, &dx, &dy);
        away_x = x - TRACKER_REAL(tracker_path_x, i);
        away_y = y - TRACKER_REAL(tracker_path_y, i);
        share = square > 0 ? (away_x * dx + away_y * dy) / square : 2;
        if (share > 1 && i < t->last && came >= 0) {
            i++;
            came = 1;
        } else if (share < 0 && i > 0 && came <= 0) {
            i--;
            came = -1;
        } else {
            break;
        }
    }
    t->where.place = i;
    t->where.share = share;
    t->error = square > 0 ? (dx * away_y - dy * away_x) / TRACKER_SQRT(square) : 0;
    tracker_real wanted = TRACKER_REAL(tracker_path_heading, i);
    tracker_real turn = TRACKER_REAL(tracker_path_heading, i + 1) - wanted;
    wanted += tracker_smaller(tracker_larger(share, 0), 1) * turn;
    wanted -= TRACKER_ATAN(t->error / TRACKER_AHEAD) + t->bias;
    turn /= tracker_larger(TRACKER_SQRT(square), (tracker_real)1e-9);
    return sense * (heading - wanted) - tracker_hysteresis(turn);
}

static int tracker_ended(const tracker *t)
{
    return !t->around && t->where.leg == TRACKER_SEGMENTS && t->where.place >= t->last && t->where.share >= 1;
}

static tracker_real tracker_look_after(tracker *t, const tracker_begin_of_dwell *from, tracker_real time)
{
    tracker_real end[3];
    tracker_moved(t, from, time, end);
    return tracker_look(t, end, from->sense);
}

static tracker_real tracker_root(tracker *t, const tracker_begin_of_dwell *from, tracker_real a, tracker_real fa,
                                 tracker_real b, tracker_real fb)
{
    tracker_real time = b;
    for (int n = 0; n < TRACKER_HALVINGS; n++) {
        time = a - fa * (b - a) / (fb - fa);
        tracker_real value = tracker_look_after(t, from, time);
        if (TRACKER_FABS(value) < TRACKER_EXACT) break;
        if (value < 0) {
            a = time;
            fa = value;
            fb /= 2;
        } else {
            b = time;
            fb = value;
            fa /= 2;
        }
    }
    return time;
}

static tracker_real tracker_end(tracker *t, const tracker_begin_of_dwell *from, tracker_real high)
{
    tracker_real low = 0;
    for (int n = 0; n < TRACKER_HALVINGS; n++) {
        tracker_real middle = (low + high) / 2;
        tracker_look_after(t, from, middle);
        if (tracker_ended(t)) high = middle;
        else low = middle;
    }
    return high;
}

/* Length of the dwell, of which some time has elapsed; *ends: whether the path ends in it. The shortest one where
 * the robot turns in circles. */
static tracker_real tracker_next(tracker *t, const tracker_begin_of_dwell *from, tracker_real elapsed, int *ends)
{
    tracker_real rate = TRACKER_FABS(t->twist[from->sense > 0 ? 0 : 1][2]), longest = TRACKER_TURNS / rate;
    tracker_real time = tracker_larger(TRACKER_SHORTEST, elapsed), low = 0, low_value = 0, slope = rate;
    tracker_real value = tracker_look_after(t, from, time);
    int looked = 0;
    *ends = 0;
    for (int n = 0; n < TRACKER_MOST_LOOKS; n++) {
        if (tracker_ended(t)) {
            *ends = 1;
            time = tracker_end(t, from, time);
            if (time < TRACKER_SHORTEST && from->before >= 0) time = 2 * time > TRACKER_SHORTEST ? TRACKER_SHORTEST : 0;
            return time;
        }
        if (value >= 0 && (!looked || value < TRACKER_EXACT)) return time;
        if (value >= 0) return tracker_root(t, from, low, low_value, time, value);
        if (-value < TRACKER_EXACT) return time;
        low = time;
        low_value = value;
        looked = 1;
        time += tracker_smaller((tracker_real)-1.02 * value / tracker_larger(slope, (tracker_real)0.1 * rate),
                                TRACKER_LARGEST_STEP / rate);
        if (time > longest) break;
        value = tracker_look_after(t, from, time);
        slope = (value - low_value) / (time - low);
    }
    return TRACKER_SHORTEST;
}
