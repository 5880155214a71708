/* ---- the reference changes with the learned drift ------------------------------------------------------------ */

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

static void tracker_turn_reference(tracker *t, tracker_real way)
{
    tracker_real heading = TRACKER_REAL(tracker_path_heading, t->place);
    tracker_real slip = tracker_slip(t->drift, heading + t->lean) - tracker_planned_slip(heading);
    way /= tracker_larger(TRACKER_ROD, TRACKER_SHORTEST_ROD);
    t->lean = (t->lean + slip) / (1 + way + way * way / 2) - slip;
}

/* Adds the mean error of the last two dwells to the integral, and turns the reference. */
static void tracker_learn(tracker *t, int sense)
{
    tracker_real pose[3] = {t->state[0], t->state[1], t->state[2]}, way = 0, dx, dy;
    tracker_look(t, pose, sense);
    for (int i = t->reached; i < t->place; i++) way += TRACKER_SQRT(tracker_step(i, &dx, &dy));
    for (int i = t->place; i < t->reached; i++) way -= TRACKER_SQRT(tracker_step(i, &dx, &dy));
    t->reached = t->place;
    t->bias += (t->error + t->last_error) * way / (4 * TRACKER_AHEAD * TRACKER_AHEAD);
    t->bias = tracker_smaller(tracker_larger(t->bias, -TRACKER_MOST_BIAS), TRACKER_MOST_BIAS);
    t->last_error = t->error;
    tracker_turn_reference(t, tracker_larger(way, 0));
}
