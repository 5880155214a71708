/* The look-up table of softflagella in C99, without a heap: the steady motion of a robot, and its response to
   a flip.

   Include this file in one C file, beside lookup_weights.h, and link with -lm. Define LOOKUP_FLOAT for single
   precision. Lengths are in tail lengths l, times in mu0 l^4/EI, angles in rad but for the slip angle.

       lookup_robot robot = {3.0, 2.8, 2.0, 6.875, 3.75, 34.375, 10.0, 2, 1.0};
       lookup_motion motion;
       lookup_flip flip;
       if (lookup_query(&robot, &motion) == LOOKUP_INSIDE) ...
       if (lookup_response(&robot, 0.8, &flip) == LOOKUP_INSIDE) ...

   The networks give the mean force of the tails. The balance of forces on head and motor is solved here, by
   Broyden's method. The formulas are those of surrogate/tails.py and surrogate/tails.py. */
#ifndef LOOKUP_H
#define LOOKUP_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lookup_weights.h"

#ifdef LOOKUP_FLOAT
typedef float lookup_real;
#define LOOKUP_F(name) name##f
#define LOOKUP_DIFFERENCE 3e-4f /* steps of finite differences, relative */
#define LOOKUP_CORRECTION 3e-6f /* where the iteration ends, relative */
#define LOOKUP_ACCEPTED 3e-6f   /* the last of all corrections, where rounding keeps them above that */
#else
typedef double lookup_real;
#define LOOKUP_F(name) name
#define LOOKUP_DIFFERENCE 1e-6
#define LOOKUP_CORRECTION 2e-12
#define LOOKUP_ACCEPTED 1e-9
#endif
#define LOOKUP_C(number) ((lookup_real)(number))
#define LOOKUP_PI LOOKUP_C(3.14159265358979323846)
#define LOOKUP_STEPS 60

enum {
    LOOKUP_INSIDE = 0,   /* a robot as the table has learned them */
    LOOKUP_OUTSIDE = 1,  /* there is an answer, without any promise */
    LOOKUP_NO_ANSWER = 2 /* no such robot, no motion found, or (response) a robot with one tail */
};

typedef struct { /* dimensionless groups; omega_bar is signed */
    lookup_real C_t, C_r, C_yr, l_over_R, L_over_R, l_over_r0, omega_bar, N, a_over_R;
} lookup_robot;

typedef struct { /* steady motion; tail_gap in 2 r0, infinite for one tail */
    lookup_real omega_t_bar, omega_h_bar, omega_yr_bar, v_x, v_z, R_yr_over_l, theta_deg, tail_gap;
} lookup_motion;

typedef struct { /* response to flips with equal dwells */
    lookup_real net_speed_bar, lag_psi_rad, lag_x, lag_z;
} lookup_flip;

typedef struct { /* numbers of a robot, and its motion (v_x of the disc, v_z, yaw rate, spin of the head) */
    lookup_real speed, sense, along, across, offset, length, slender, drag, spin_drag, side, tails;
    lookup_real u[4];
    const lookup_network *wrench;
} lookup_body;

/* ---- networks ------------------------------------------------------------------------------------------------ */

static lookup_real lookup_half(uint16_t half)
{
    uint32_t bits = (uint32_t)(half & 0x7fff) << 13;
    float value;
    memcpy(&value, &bits, sizeof value);
    value *= 5192296858534827628530496329220096.0f; /* 2^112 */
    return LOOKUP_C(half & 0x8000 ? -value : value);
}

/* out[j] += factor * numbers[first + j], for 16-bit or 32-bit numbers */
static void lookup_add(int half, const void *numbers, int first, lookup_real factor, lookup_real *out, int count)
{
    const uint16_t *short_row = (const uint16_t *)numbers + first;
    const float *row = (const float *)numbers + first;
    if (half)
        for (int j = 0; j < count; j++) out[j] += factor * lookup_half(short_row[j]);
    else
        for (int j = 0; j < count; j++) out[j] += factor * LOOKUP_C(row[j]);
}

static void lookup_network_at(const lookup_network *net, const lookup_real *inputs, lookup_real *out)
{
    lookup_real first[LOOKUP_INPUTS], one[LOOKUP_WIDTH], two[LOOKUP_WIDTH];
    const lookup_real *h = first;
    int in = net->inputs;
    for (int i = 0; i < in; i++) first[i] = (inputs[i] - LOOKUP_C(net->shift[i])) / LOOKUP_C(net->scale[i]);
    for (int k = 0; k <= net->depth; k++) {
        int count = k < net->depth ? net->width : net->outputs;
        int half = k == net->depth ? net->half_last : net->half;
        lookup_real *next = k == net->depth ? out : k % 2 ? two : one;
        for (int j = 0; j < count; j++) next[j] = 0;
        lookup_add(half, net->biases[k], 0, 1, next, count);
        for (int i = 0; i < in; i++) lookup_add(half, net->weights[k], i * count, h[i], next, count);
        for (int j = 0; j < count && k < net->depth; j++) next[j] = LOOKUP_F(tanh)(next[j]);
        h = next;
        in = count;
    }
    in = net->outputs;
    for (int i = 0; i < net->inputs; i++) lookup_add(net->half, net->bypass, i * in, first[i], out, in);
    for (int j = 0; j < net->outputs; j++) out[j] = out[j] * LOOKUP_C(net->spread[j]) + LOOKUP_C(net->mean[j]);
}

/* ---- the balance of forces ----------------------------------------------------------------------------------- */

static lookup_real lookup_asinh(lookup_real x)
{
    lookup_real size = LOOKUP_F(fabs)(x);
    size = LOOKUP_F(log)(size + LOOKUP_F(sqrt)(size * size + 1));
    return x < 0 ? -size : size;
}

static lookup_real lookup_thrust(lookup_real S)
{
    return LOOKUP_C(0.125) * S / (1 + LOOKUP_F(pow)(S / 8, LOOKUP_C(1.35)));
}

static lookup_real lookup_torque(lookup_real S)
{
    return LOOKUP_F(pow)(1 + S * S / 36, LOOKUP_C(-0.125));
}

static int lookup_body_of(const lookup_robot *robot, lookup_body *body)
{
    lookup_real log_slender = LOOKUP_F(log)(robot->l_over_r0), R = 1 / robot->l_over_R;
    if (!(robot->C_t > 0 && robot->C_r > 0 && robot->C_yr > 0 && robot->l_over_R > 0 && robot->L_over_R > 0 &&
          robot->l_over_r0 > 5 && robot->omega_bar != 0 && robot->N >= 1 && robot->a_over_R > 0))
        return 0;
    body->sense = robot->omega_bar < 0 ? LOOKUP_C(-1) : LOOKUP_C(1);
    body->speed = LOOKUP_F(fabs)(robot->omega_bar);
    body->along = 2 * LOOKUP_PI / (log_slender - LOOKUP_C(0.5));
    body->across = 4 * LOOKUP_PI / (log_slender + LOOKUP_C(0.5));
    body->offset = robot->a_over_R * R;
    body->length = robot->L_over_R * R;
    body->slender = robot->l_over_r0;
    body->drag = 6 * LOOKUP_PI * robot->C_t * R;
    body->spin_drag = 8 * LOOKUP_PI * robot->C_r * R * R * R;
    body->side = robot->C_yr * R * body->length;
    body->tails = robot->N;
    body->wrench = &lookup_networks[robot->N < 2 ? 0 : robot->N < 3 ? 1 : 2];
    return body->wrench->inputs > 0;
}

/* Inputs of the tails, and from x[7] on those of the head. */
static void lookup_tail_inputs(const lookup_body *body, const lookup_real *u, lookup_real *x)
{
    lookup_real total = body->tails * body->across;
    lookup_real spin = body->speed + u[3], S = body->across * spin;
    lookup_real sideways = LOOKUP_F(sqrt)(u[0] * u[0] + u[2] * u[2]);
    x[0] = LOOKUP_F(log)(S);
    x[1] = LOOKUP_F(log)(body->offset);
    x[2] = LOOKUP_F(log)(body->slender);
    x[3] = lookup_asinh(20 * sideways / spin * S / (S + 12));
    x[4] = LOOKUP_F(atan2)(u[0], u[2]);
    x[5] = lookup_asinh(20 * u[1] / (body->offset * spin));
    x[6] = LOOKUP_F(log)(body->spin_drag / (total * body->offset * body->offset));
    x[7] = x[8] = LOOKUP_F(log)(body->drag / total);
    x[9] = x[7] + 2 * LOOKUP_F(log)(body->length / 2);
    x[10] = LOOKUP_F(log)(body->length);
    x[11] = 1;
    x[12] = LOOKUP_F(log)(body->side / total);
    x[13] = 0;
}

/* The numbers of the tails at the velocities u. The network of a single tail sees the head, and no velocity. */
static void lookup_numbers(const lookup_body *body, const lookup_real *u, lookup_real *y)
{
    lookup_real x[LOOKUP_INPUTS];
    lookup_tail_inputs(body, u, x);
    if (body->tails < LOOKUP_C(1.5)) {
        x[3] = x[6];
        for (int i = 4; i < 11; i++) x[i] = x[i + 3];
        x[11] = x[12] = 0; /* couple of the tails' spin, ln gain of the motor */
    }
    lookup_network_at(body->wrench, x, y);
}

/* Forces (x, z) and moments (y, z) about the disc that are left at the velocities u, for numbers y of the tails. */
static void lookup_unbalanced(const lookup_body *body, const lookup_real *u, const lookup_real *y, lookup_real *left)
{
    lookup_real spin = body->speed + u[3], S = body->across * spin;
    lookup_real across = body->tails * body->across, lever = body->length / 2;
    lookup_real sideways = LOOKUP_F(sqrt)(u[0] * u[0] + u[2] * u[2]);
    lookup_real squared = sideways * sideways / (body->offset * body->offset * spin * spin);
    lookup_real couple = body->tails * spin * body->offset * body->offset;
    lookup_real thrust = (body->across - body->along) * couple * lookup_thrust(S);
    lookup_real torque = body->across * couple * lookup_torque(S);
    lookup_real on_head = body->drag * (u[0] + lever * u[2]) + body->side * u[3];
    left[0] = across * (u[2] / 2 - u[0]) + across * sideways * y[0] - on_head;
    left[1] = thrust * (y[1] + squared * y[4]) - (body->tails * body->along + body->drag) * u[1];
    left[2] = across * (u[0] / 2 - u[2] / 3) + across * sideways * y[2] - lever * on_head;
    left[3] = -torque * (y[3] + squared * y[5]) - body->spin_drag * u[3];
}

/* The first guess: linear theory for the tails' torque and thrust, straight tails for the side forces. */
static void lookup_guess(const lookup_body *body, lookup_real *u)
{
    lookup_real across = body->tails * body->across, lever = body->length / 2, spin = LOOKUP_C(0.6) * body->speed;
    lookup_real a = body->drag + across, b = body->drag * lever - across / 2;
    lookup_real d = body->drag * lever * lever + across / 3, size = a * d - b * b, push;
    for (int i = 0; i < 3; i++) {
        lookup_real torque = across * body->offset * body->offset * lookup_torque(body->across * spin);
        spin = body->speed * body->spin_drag / (body->spin_drag + torque);
    }
    u[3] = spin - body->speed;
    u[1] = body->tails * (body->across - body->along) * spin * body->offset * body->offset *
           lookup_thrust(body->across * spin) / (body->drag + body->tails * body->along);
    push = -body->side * u[3];
    u[0] = push * (d - b * lever) / size;
    u[2] = push * (a * lever - b) / size;
}

/* The inverse of a 4 x 4 matrix by elimination; 0 if there is none. */
static int lookup_inverse(lookup_real matrix[4][4], lookup_real inverse[4][4])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) inverse[i][j] = i == j;
    for (int k = 0; k < 4; k++) {
        int best = k;
        lookup_real pivot;
        for (int i = k + 1; i < 4; i++)
            if (LOOKUP_F(fabs)(matrix[i][k]) > LOOKUP_F(fabs)(matrix[best][k])) best = i;
        pivot = matrix[best][k];
        if (!(LOOKUP_F(fabs)(pivot) > 0)) return 0;
        for (int j = 0; j < 4; j++) {
            lookup_real a = matrix[best][j], b = inverse[best][j];
            matrix[best][j] = matrix[k][j], inverse[best][j] = inverse[k][j];
            matrix[k][j] = a / pivot, inverse[k][j] = b / pivot;
        }
        for (int i = 0; i < 4; i++) {
            lookup_real share = matrix[i][k];
            if (i == k) continue;
            for (int j = 0; j < 4; j++) {
                matrix[i][j] -= share * matrix[k][j];
                inverse[i][j] -= share * inverse[k][j];
            }
        }
    }
    return 1;
}

/* What is unbalanced, and the inverse of its derivative, by differences, with the tails' numbers held. */
static int lookup_begin(const lookup_body *body, const lookup_real *u, lookup_real *left,
                        lookup_real inverse[4][4])
{
    lookup_real slope[4][4], moved[4], there[4], y[LOOKUP_OUTPUTS], largest = 0;
    lookup_numbers(body, u, y);
    lookup_unbalanced(body, u, y, left);
    for (int j = 0; j < 4; j++) largest = LOOKUP_F(fmax)(largest, LOOKUP_F(fabs)(u[j]));
    for (int j = 0; j < 4; j++) {
        lookup_real width = LOOKUP_DIFFERENCE * (LOOKUP_F(fabs)(u[j]) + LOOKUP_C(1e-3) * largest);
        memcpy(moved, u, sizeof moved);
        moved[j] += width;
        width = moved[j] - u[j];
        lookup_unbalanced(body, moved, y, there);
        for (int i = 0; i < 4; i++) slope[i][j] = (there[i] - left[i]) / width;
    }
    return lookup_inverse(slope, inverse);
}

static lookup_real lookup_size_of(const lookup_real *step, const lookup_real *u)
{
    lookup_real speed = LOOKUP_F(sqrt)(u[0] * u[0] + u[1] * u[1]) + LOOKUP_F(fabs)(u[2]);
    lookup_real moved = LOOKUP_F(fmax)(LOOKUP_F(fabs)(step[0]), LOOKUP_F(fabs)(step[1])) / speed;
    lookup_real turned = LOOKUP_F(fmax)(LOOKUP_F(fabs)(step[2] / u[2]), LOOKUP_F(fabs)(step[3] / u[3]));
    return LOOKUP_F(fmax)(moved, turned);
}

/* The inverse after a step that changed the balance so (Broyden's good update). */
static void lookup_update(lookup_real inverse[4][4], const lookup_real *way, const lookup_real *change)
{
    lookup_real missed[4], along[4], size = 0;
    for (int i = 0; i < 4; i++) {
        missed[i] = way[i];
        along[i] = 0;
        for (int j = 0; j < 4; j++) {
            missed[i] -= inverse[i][j] * change[j];
            along[i] += way[j] * inverse[j][i];
        }
    }
    for (int i = 0; i < 4; i++) size += along[i] * change[i];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            lookup_real more = missed[i] * along[j] / size;
            if (isfinite(more)) inverse[i][j] += more;
        }
}

/* The velocities in balance; 0 if none were found. */
static int lookup_solve(lookup_body *body)
{
    lookup_real *u = body->u;
    lookup_real left[4], now[4], way[4], change[4], inverse[4][4], y[LOOKUP_OUTPUTS], size = LOOKUP_C(HUGE_VAL);
    lookup_guess(body, u);
    if (!lookup_begin(body, u, left, inverse)) return 0;
    for (int count = 0; count < LOOKUP_STEPS; count++) {
        lookup_real share;
        for (int i = 0; i < 4; i++) {
            way[i] = 0;
            for (int j = 0; j < 4; j++) way[i] -= inverse[i][j] * left[j];
        }
        share = LOOKUP_F(fabs)(way[3]) / (body->speed + u[3]); /* change of the tails' spin */
        for (int i = 0; i < 4; i++) {
            if (share > LOOKUP_C(0.5)) way[i] *= LOOKUP_C(0.5) / share;
            u[i] += way[i];
        }
        if (!(body->speed + u[3] > 0)) return 0;
        size = lookup_size_of(way, u);
        if (size < LOOKUP_CORRECTION) return 1;
        if (!isfinite(size)) return 0;
        lookup_numbers(body, u, y);
        lookup_unbalanced(body, u, y, now);
        for (int i = 0; i < 4; i++) change[i] = now[i] - left[i];
        lookup_update(inverse, way, change);
        memcpy(left, now, sizeof left);
    }
    return size < LOOKUP_ACCEPTED;
}

static int lookup_within(const lookup_robot *robot)
{
    const lookup_real *values = &robot->C_t;
    for (int i = 0; i < 9; i++) {
        lookup_real size = LOOKUP_F(fabs)(values[i]);
        if (!(size >= LOOKUP_C(lookup_low[i]) && size <= LOOKUP_C(lookup_high[i]))) return 0;
    }
    return 1;
}

static int lookup_answer(const lookup_robot *robot, lookup_body *body, lookup_motion *motion)
{
    lookup_real x[LOOKUP_INPUTS], share, sway, spin, *u = body->u;
    int found = lookup_body_of(robot, body) ? lookup_solve(body) : 0;
    if (!found) return LOOKUP_NO_ANSWER;
    spin = body->speed + u[3];
    sway = u[0] + u[2] * body->length / 2;
    motion->omega_t_bar = body->sense * spin;
    motion->omega_h_bar = body->sense * u[3];
    motion->omega_yr_bar = body->sense * u[2];
    motion->v_x = body->sense * sway;
    motion->v_z = u[1];
    motion->R_yr_over_l = LOOKUP_F(sqrt)(sway * sway + u[1] * u[1]) / LOOKUP_F(fabs)(u[2]);
    motion->theta_deg = 180 / LOOKUP_PI * LOOKUP_F(atan2)(LOOKUP_F(fabs)(sway), u[1]);
    lookup_tail_inputs(body, u, x);
    x[7] = LOOKUP_F(log)(body->tails);
    lookup_network_at(&lookup_networks[3], x, &share);
    motion->tail_gap = share * body->offset * LOOKUP_F(sin)(LOOKUP_PI / body->tails) * body->slender;
    if (body->tails < LOOKUP_C(1.5)) motion->tail_gap = LOOKUP_C(HUGE_VAL);
    if (!lookup_within(robot) || !(LOOKUP_F(fabs)(u[2]) <= LOOKUP_C(0.6) * spin)) return LOOKUP_OUTSIDE;
    return LOOKUP_INSIDE;
}

static inline int lookup_query(const lookup_robot *robot, lookup_motion *motion)
{
    lookup_body body;
    return lookup_answer(robot, &body, motion);
}

/* ---- the response to a flip ---------------------------------------------------------------------------------- */

/* Lags (z, x, psi) at a dwell, cubic in ln dwell through four of the dwells of the table. */
static void lookup_lags(const lookup_body *body, lookup_real dwell, lookup_real *lag)
{
    lookup_real x[LOOKUP_INPUTS], c[2 * LOOKUP_COMPONENTS], place, speeds[3];
    lookup_real sway = body->u[0] + body->u[2] * body->length / 2;
    int first = 0;
    lookup_tail_inputs(body, body->u, x);
    x[11] = x[12], x[12] = x[13];
    x[13] = LOOKUP_F(log)(body->tails);
    x[14] = body->tails < LOOKUP_C(2.5);
    lookup_network_at(&lookup_networks[4], x, c);
    lookup_network_at(&lookup_networks[5], x, c + LOOKUP_COMPONENTS);
    speeds[0] = LOOKUP_F(sqrt)(body->u[1] * body->u[1] + sway * sway / 100);
    speeds[1] = sway;
    speeds[2] = body->u[2];
    if (dwell > LOOKUP_C(lookup_dwells[LOOKUP_DWELLS - 1])) dwell = LOOKUP_C(lookup_dwells[LOOKUP_DWELLS - 1]);
    while (first < LOOKUP_DWELLS - 4 && LOOKUP_C(lookup_dwells[first + 2]) < dwell) first++;
    place = LOOKUP_F(log)(dwell);
    lag[0] = lag[1] = lag[2] = 0;
    for (int i = first; i < first + 4; i++) {
        lookup_real weight = 1, at = LOOKUP_F(log)(LOOKUP_C(lookup_dwells[i]));
        for (int j = first; j < first + 4; j++) {
            lookup_real other = LOOKUP_F(log)(LOOKUP_C(lookup_dwells[j]));
            if (j != i) weight *= (place - other) / (at - other);
        }
        for (int p = 0; p < 3; p++) {
            lookup_real curve = LOOKUP_C(lookup_curve_mean[3 * i + p]);
            for (int k = 0; k < 2 * LOOKUP_COMPONENTS; k++)
                curve += c[k] * lookup_half(lookup_curve_basis[3 * (LOOKUP_DWELLS * k + i) + p]);
            lag[p] += weight * curve * speeds[p];
        }
    }
}

static inline int lookup_response(const lookup_robot *robot, lookup_real dwell, lookup_flip *flip)
{
    lookup_body body;
    lookup_motion motion;
    lookup_real lag[3], turn, along, across, x, y, way, aside;
    int state = lookup_answer(robot, &body, &motion);
    if (state == LOOKUP_NO_ANSWER || body.tails < LOOKUP_C(1.5)) return LOOKUP_NO_ANSWER;
    if (!(dwell >= LOOKUP_C(lookup_dwells[0]) * (1 - LOOKUP_C(1e-6)))) return LOOKUP_NO_ANSWER;
    lookup_lags(&body, dwell, lag);
    /* one dwell: the lag, then an arc of the steady motion; the next one is its mirror image */
    turn = body.u[2] * dwell;
    along = dwell * LOOKUP_F(sin)(turn) / turn;
    across = dwell * 2 * LOOKUP_F(sin)(turn / 2) * LOOKUP_F(sin)(turn / 2) / turn;
    x = along * motion.v_z - across * body.sense * motion.v_x;
    y = across * motion.v_z + along * body.sense * motion.v_x;
    way = lag[0] + LOOKUP_F(cos)(lag[2]) * x - LOOKUP_F(sin)(lag[2]) * y;
    aside = lag[1] + LOOKUP_F(sin)(lag[2]) * x + LOOKUP_F(cos)(lag[2]) * y;
    turn += lag[2];
    x = way + LOOKUP_F(cos)(turn) * way + LOOKUP_F(sin)(turn) * aside;
    y = aside + LOOKUP_F(sin)(turn) * way - LOOKUP_F(cos)(turn) * aside;
    flip->net_speed_bar = LOOKUP_F(sqrt)(x * x + y * y) / (2 * dwell);
    flip->lag_psi_rad = lag[2];
    flip->lag_x = lag[1];
    flip->lag_z = lag[0];
    return state;
}

#endif
