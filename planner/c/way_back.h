/* ---- the way back: a shortest Dubins track to the remaining path ---------------------------------------------- */

static tracker_real tracker_whole_turn(tracker_real angle)
{
    angle -= 2 * TRACKER_PI * TRACKER_FLOOR(angle / (2 * TRACKER_PI));
    return angle > 2 * TRACKER_PI - TRACKER_ROUNDING ? 0 : angle;
}

/* The lengths of the segments of one of the six words; 0 if it does not exist. */
static int tracker_word(int word, tracker_real d, tracker_real a, tracker_real b, tracker_real lengths[3])
{
    tracker_real sa = TRACKER_SIN(a), sb = TRACKER_SIN(b), ca = TRACKER_COS(a), cb = TRACKER_COS(b);
    tracker_real cab = TRACKER_COS(a - b), side = word % 2 ? (tracker_real)-1 : (tracker_real)1, p, angle, t, q;
    if (word < 2) {
        tracker_real square = 2 + d * d - 2 * cab + side * 2 * d * (sa - sb);
        if (square < -TRACKER_ROUNDING) return 0;
        angle = TRACKER_ATAN2(side * (cb - ca), d + side * (sa - sb));
        p = TRACKER_SQRT(tracker_larger(square, 0));
        t = side * (angle - a);
        q = side * (b - angle);
    } else if (word < 4) {
        tracker_real square = d * d - 2 + 2 * cab + side * 2 * d * (sa + sb);
        if (square < -TRACKER_ROUNDING) return 0;
        p = TRACKER_SQRT(tracker_larger(square, 0));
        angle = TRACKER_ATAN2(-side * (ca + cb), d + side * (sa + sb)) - TRACKER_ATAN2(-side * 2, p);
        t = side * (angle - a);
        q = side * (angle - b);
    } else {
        tracker_real cosine = (6 - d * d + 2 * cab + side * 2 * d * (sa - sb)) / 8;
        if (!(TRACKER_FABS(cosine) <= 1)) return 0;
        p = 2 * TRACKER_PI - TRACKER_ACOS(cosine);
        t = side * a - TRACKER_ATAN2(ca - cb, d - side * (sa - sb)) + p / 2;
        q = side * (a - b) - t + p;
    }
    lengths[0] = tracker_whole_turn(t);
    lengths[1] = p;
    lengths[2] = tracker_whole_turn(q);
    return 1;
}

/* The shortest track between two poses, as curvatures and lengths of `way`; returns its length. */
static tracker_real tracker_shortest(const tracker_real from[3], const tracker_real to[3], tracker_real radius,
                                     tracker_segment way[TRACKER_SEGMENTS])
{
    static const signed char turns[6][3] = {{1, 0, 1}, {-1, 0, -1}, {1, 0, -1}, {-1, 0, 1}, {-1, 1, -1}, {1, -1, 1}};
    tracker_real x = (to[0] - from[0]) / radius, y = (to[1] - from[1]) / radius, best = -1, lengths[3];
    tracker_real d = TRACKER_SQRT(x * x + y * y), direction = TRACKER_ATAN2(y, x);
    for (int word = 0; word < 6; word++) {
        if (!tracker_word(word, d, from[2] - direction, to[2] - direction, lengths)) continue;
        for (int i = 0; i < 3; i++) lengths[i] *= radius;
        tracker_real length = lengths[0] + lengths[1] + lengths[2];
        if (best >= 0 && !(length < best)) continue;
        best = length;
        for (int i = 0; i < 3; i++) {
            way[i].length = lengths[i];
            way[i].curvature = turns[word][i] / radius;
        }
    }
    return best;
}

/* Place and course of the pivot on point i of the path, and the lean of the reference there. */
static tracker_real tracker_target(const tracker *t, int i, tracker_real to[3])
{
    tracker_real heading = TRACKER_REAL(tracker_path_heading, i), known = tracker_planned_slip(heading);
    tracker_real lean = known - tracker_slip(t->drift, heading);
    to[0] = TRACKER_REAL(tracker_path_x, i) + TRACKER_ROD * (TRACKER_COS(heading) - TRACKER_COS(heading + lean));
    to[1] = TRACKER_REAL(tracker_path_y, i) + TRACKER_ROD * (TRACKER_SIN(heading) - TRACKER_SIN(heading + lean));
    to[2] = heading + known;
    return lean;
}

/* The cheapest of the points first, first + stride, ... up to last; *left_out is the path's length before first. */
static int tracker_cheapest(tracker *t, const tracker_real from[3], tracker_real radius, int first, int last,
                            int stride, tracker_real left_out)
{
    tracker_segment way[TRACKER_SEGMENTS];
    tracker_real best = -1, to[3], dx, dy;
    int target = first;
    for (int i = first; i <= last; i++) {
        tracker_real cost = TRACKER_LEFT_OUT * left_out;
        if (best >= 0 && cost >= best) break;
        if ((i - first) % stride == 0) {
            tracker_target(t, i, to);
            dx = to[0] - from[0];
            dy = to[1] - from[1];
            if (best < 0 || cost + (tracker_real)0.999 * TRACKER_SQRT(dx * dx + dy * dy) < best) {
                cost += tracker_shortest(from, to, radius, way);
                if (best < 0 || cost < best) {
                    best = cost;
                    target = i;
                }
            }
        }
        if (i < last) left_out += TRACKER_SQRT(tracker_step(i, &dx, &dy));
    }
    return target;
}

/* Plans the way back from a pose to the path that remains after the place. */
static void tracker_plan_way(tracker *t, const tracker_real pose[3])
{
    int first = t->on_way ? t->target : t->where.place, target, low, high;
    tracker_real from[3], to[3], left_out = 0, dx, dy, radius, lean, course;
    radius = tracker_larger(TRACKER_FABS(t->twist[0][0] / t->twist[0][2]), TRACKER_FABS(t->twist[1][0] / t->twist[1][2]));
    radius = radius * (1 + TRACKER_SQRT(t->drift[1] * t->drift[1] + t->drift[2] * t->drift[2])) / TRACKER_ROOM;
    tracker_pivot(t, pose, from);
    target = tracker_cheapest(t, from, radius, first, t->last + 1, TRACKER_STRIDE, 0);
    low = target - TRACKER_STRIDE + 1 > first ? target - TRACKER_STRIDE + 1 : first;
    high = target + TRACKER_STRIDE < t->last + 2 ? target + TRACKER_STRIDE - 1 : t->last + 1;
    for (int i = first; i < low; i++) left_out += TRACKER_SQRT(tracker_step(i, &dx, &dy));
    target = tracker_cheapest(t, from, radius, low, high, 1, left_out);
    lean = tracker_target(t, target, to);
    tracker_shortest(from, to, radius, t->way);
    for (int i = 0; i < TRACKER_SEGMENTS; i++) {
        tracker_segment *segment = &t->way[i];
        segment->x = from[0];
        segment->y = from[1];
        segment->course = from[2];
        course = from[2] + segment->curvature * segment->length;
        if (segment->curvature == 0) {
            from[0] += segment->length * TRACKER_COS(from[2]);
            from[1] += segment->length * TRACKER_SIN(from[2]);
        } else {
            from[0] += (TRACKER_SIN(course) - TRACKER_SIN(from[2])) / segment->curvature;
            from[1] -= (TRACKER_COS(course) - TRACKER_COS(from[2])) / segment->curvature;
        }
        from[2] = course;
    }
    t->on_way = 1;
    t->target = target < t->last ? target : t->last;
    t->where.leg = 0;
    t->where.along = 0;
    t->where.place = t->target;
    t->where.share = 0;
    t->turns = 2 * TRACKER_PI * TRACKER_FLOOR((from[2] - to[2]) / (2 * TRACKER_PI) + (tracker_real)0.5);
    t->lean = lean + t->turns;
}

/* Side to which the way turns first; 0 for a straight way. */
static int tracker_first_turn(const tracker *t)
{
    for (int i = 0; t->on_way && i < TRACKER_SEGMENTS; i++)
        if (t->way[i].curvature != 0 && t->way[i].length > TRACKER_STRAIGHT) return t->way[i].curvature > 0 ? 1 : -1;
    return 0;
}
