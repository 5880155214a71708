/* ---- guidance about the path, which changes with the learned drift, or about the way back to it --------------- */

/* Angle from a heading to the direction of motion; a drift has a part to the left and a current. */
static tracker_real tracker_slip(const tracker_real drift[3], tracker_real heading)
{
    tracker_real c = TRACKER_COS(heading), s = TRACKER_SIN(heading);
    return TRACKER_ATAN2(drift[0] - drift[1] * s + drift[2] * c, 1 + drift[1] * c + drift[2] * s);
}

static tracker_real tracker_planned_slip(tracker_real heading)
{
    const tracker_real planned[3] = {TRACKER_NET_DRIFT / TRACKER_NET_SPEED, tracker_current[0] / TRACKER_NET_SPEED,
                                     tracker_current[1] / TRACKER_NET_SPEED};
    return tracker_slip(planned, heading);
}

/* Place and course of the pivot. */
static void tracker_pivot(const tracker *t, const tracker_real pose[3], tracker_real pivot[3])
{
    pivot[0] = pose[0] - TRACKER_PIVOT_DISTANCE * TRACKER_COS(pose[2]);
    pivot[1] = pose[1] - TRACKER_PIVOT_DISTANCE * TRACKER_SIN(pose[2]);
    pivot[2] = pose[2] + tracker_slip(t->drift, pose[2]);
}

/* Progress along a segment; *error is the distance to its left. On an arc it is nearest to `near`. */
static tracker_real tracker_project(const tracker_segment *segment, const tracker_real pivot[3], tracker_real near_to,
                                    tracker_real *error)
{
    tracker_real c = TRACKER_COS(segment->course), s = TRACKER_SIN(segment->course);
    if (segment->curvature == 0) {
        tracker_real ahead = pivot[0] - segment->x, aside = pivot[1] - segment->y;
        *error = c * aside - s * ahead;
        return c * ahead + s * aside;
    }
    tracker_real side = segment->curvature > 0 ? (tracker_real)1 : (tracker_real)-1;
    tracker_real ahead = pivot[0] - (segment->x - s / segment->curvature);
    tracker_real aside = pivot[1] - (segment->y + c / segment->curvature);
    tracker_real turned = TRACKER_ATAN2(aside, ahead) + side * TRACKER_PI / 2 - segment->course - segment->curvature * near_to;
    turned -= 2 * TRACKER_PI * TRACKER_FLOOR((turned + TRACKER_PI) / (2 * TRACKER_PI));
    *error = 1 / segment->curvature - side * TRACKER_SQRT(ahead * ahead + aside * aside);
    return near_to + turned / segment->curvature;
}

/* sigma (phi - phi_d) - h about the way, or after it about the path. */
static tracker_real tracker_look(tracker *t, const tracker_real pose[3], int sense)
{
    const tracker_segment *segment;
    tracker_real pivot[3], along, error;
    int came = 0;
    if (!t->on_way) return tracker_look_at_path(t, pose, sense);
    if (t->where.leg == TRACKER_SEGMENTS) {
        tracker_real value = tracker_look_at_path(t, pose, sense);
        if (t->where.place > t->target || (t->where.place == t->target && t->where.share >= 0)) return value;
        t->where.leg = TRACKER_SEGMENTS - 1;
        t->where.along = t->way[TRACKER_SEGMENTS - 1].length;
        came = -1;
    }
    t->where.place = t->target;
    tracker_pivot(t, pose, pivot);
    for (;;) {
        segment = &t->way[t->where.leg];
        along = tracker_project(segment, pivot, t->where.along, &error);
        if (along > segment->length && came >= 0) {
            t->where.leg++;
            t->where.along = 0;
            came = 1;
            if (t->where.leg == TRACKER_SEGMENTS) return tracker_look_at_path(t, pose, sense);
        } else if (along < 0 && t->where.leg > 0 && came <= 0) {
            t->where.leg--;
            t->where.along = t->way[t->where.leg].length;
            came = -1;
        } else {
            break;
        }
    }
    t->where.along = along;
    t->error = error;
    tracker_real wanted = segment->course + segment->curvature * along - TRACKER_ATAN(error / TRACKER_WAY_AHEAD);
    return sense * (pivot[2] - wanted) - tracker_hysteresis(segment->curvature);
}

/* How far the place on the path is beyond its step. */
static tracker_real tracker_beyond(const tracker *t, tracker_real step)
{
    return step * tracker_larger(tracker_larger(t->where.share - 1, -t->where.share), 0);
}

/* The curvature of the reference at the place, and the length of its step. */
static tracker_real tracker_bend(const tracker *t, tracker_real *step)
{
    int i = t->where.place;
    tracker_real dx, dy, turn = TRACKER_REAL(tracker_path_heading, i + 1) - TRACKER_REAL(tracker_path_heading, i);
    *step = TRACKER_SQRT(tracker_step(i, &dx, &dy));
    return turn / tracker_larger(*step, TRACKER_SHORTEST_ROD);
}

/* 1 if a pose is too far from path or way for the line of sight. */
static int tracker_is_off(tracker *t, const tracker_real pose[3])
{
    tracker_real deviation = tracker_look(t, pose, 1), step, beyond, bend;
    if (t->where.leg < TRACKER_SEGMENTS) {
        deviation += tracker_hysteresis(t->way[t->where.leg].curvature);
        return TRACKER_FABS(t->error) > TRACKER_LIMIT || TRACKER_FABS(deviation) > TRACKER_AWAY;
    }
    bend = tracker_bend(t, &step);
    beyond = tracker_beyond(t, step);
    deviation += tracker_hysteresis(bend);
    return t->error * t->error + beyond * beyond > TRACKER_LIMIT * TRACKER_LIMIT || TRACKER_FABS(deviation) > TRACKER_AWAY;
}

/* Distance of the tracked point from the path, on the way back from its end; *direction is that of the distance. */
static tracker_real tracker_distance(tracker *t, const tracker_real pose[3], tracker_real *direction)
{
    tracker_real value = tracker_look(t, pose, 1), step, bend, heading, turned, slip, tangent, ahead, aside, beyond;
    heading = TRACKER_REAL(tracker_path_heading, t->where.place);
    if (t->where.leg < TRACKER_SEGMENTS) {
        tracker_real x = pose[0] + TRACKER_OFFSET * TRACKER_COS(pose[2]) - TRACKER_REAL(tracker_path_x, t->where.place);
        tracker_real y = pose[1] + TRACKER_OFFSET * TRACKER_SIN(pose[2]) - TRACKER_REAL(tracker_path_y, t->where.place);
        x -= TRACKER_ROD * TRACKER_COS(heading);
        y -= TRACKER_ROD * TRACKER_SIN(heading);
        *direction = TRACKER_ATAN2(y, x);
        return TRACKER_SQRT(x * x + y * y);
    }
    bend = tracker_bend(t, &step);
    turned = value + tracker_hysteresis(bend) - TRACKER_ATAN(t->error / TRACKER_AHEAD) - t->bias;
    slip = tracker_planned_slip(heading);
    tangent = TRACKER_ATAN2(TRACKER_SIN(slip) + TRACKER_ROD * bend, TRACKER_COS(slip));
    ahead = TRACKER_ROD * (TRACKER_COS(turned) - 1);
    aside = t->error + TRACKER_ROD * TRACKER_SIN(turned);
    value = TRACKER_COS(tangent) * aside - TRACKER_SIN(tangent) * ahead;
    beyond = tracker_beyond(t, step);
    *direction = pose[2] - turned + tangent + TRACKER_PI / 2;
    beyond = TRACKER_SQRT(value * value + beyond * beyond);
    return value < 0 ? -beyond : beyond;
}

static void tracker_turn_reference(tracker *t, tracker_real way)
{
    tracker_real heading = TRACKER_REAL(tracker_path_heading, t->where.place), lean = t->lean - t->turns;
    tracker_real slip = tracker_slip(t->drift, heading + lean) - tracker_planned_slip(heading), step;
    tracker_real left = TRACKER_FABS(t->twist[0][1]) + TRACKER_FABS(t->twist[1][1]);
    tracker_real rate = TRACKER_FABS(t->twist[0][2]) + TRACKER_FABS(t->twist[1][2]);
    slip += (left / rate - TRACKER_PIVOT_DISTANCE) * tracker_bend(t, &step);
    way /= tracker_larger(TRACKER_ROD, TRACKER_SHORTEST_ROD);
    t->lean = (lean + slip) / (1 + way + way * way / 2) - slip + t->turns;
}

/* Begins the next lap at the end of one. */
static void tracker_go_around(tracker *t)
{
    if (t->around && !t->on_way && t->where.place >= TRACKER_LAP) {
        t->where.place -= TRACKER_LAP;
        t->reached -= TRACKER_LAP;
        t->lean += TRACKER_LAP_TURN;
        t->turns += TRACKER_LAP_TURN;
    }
    if (t->stopping && !t->on_way && t->where.place < TRACKER_LAP) {
        t->around = 0;
        t->last = TRACKER_LAP - 1;
    }
}

/* Adds the mean error of the last two dwells to the integral, and turns the reference. */
static void tracker_learn(tracker *t, int sense)
{
    tracker_real pose[3] = {t->state[0], t->state[1], t->state[2]}, way = 0, dx, dy;
    if (t->on_way) {
        tracker_look(t, pose, sense);
        if (t->where.leg < TRACKER_SEGMENTS) return;
        t->on_way = 0;
        t->reached = t->where.place;
        t->last_error = 0;
    }
    tracker_look(t, pose, sense);
    for (int i = t->reached; i < t->where.place; i++) way += TRACKER_SQRT(tracker_step(i, &dx, &dy));
    for (int i = t->where.place; i < t->reached; i++) way -= TRACKER_SQRT(tracker_step(i, &dx, &dy));
    t->reached = t->where.place;
    t->bias += (t->error + t->last_error) * way / (4 * TRACKER_AHEAD * TRACKER_AHEAD);
    t->bias = tracker_smaller(tracker_larger(t->bias, -TRACKER_MOST_BIAS), TRACKER_MOST_BIAS);
    t->last_error = t->error;
    tracker_turn_reference(t, tracker_larger(way, 0));
    tracker_go_around(t);
}
