/* tracker.h as a library, for tests/planner/compiled.py. */
#include "tracker.h"
#ifdef __cplusplus
extern "C" {
#endif
void begin(double noise, double heading, const double *start);
void feed(double now, const double *pose, double seen, double *out);
void finish(double *out);
int memory(void);
#ifdef __cplusplus
}
#endif
static tracker keeper;
static void told(tracker_advice advice, double *out)
{
    out[0] = advice.direction; out[1] = advice.flip_at; out[2] = advice.finished; out[3] = advice.alarm;
    out[4] = advice.error;
    for (int i = 0; i < TRACKER_STATES; i++) out[5 + i] = keeper.state[i];
}
void begin(double noise, double heading, const double *start)
{
    tracker_real own[3] = {0, 0, 0};
    for (int i = 0; i < 3 && start; i++) own[i] = (tracker_real)start[i];
    if (start) tracker_begin_at(&keeper, (tracker_real)noise, (tracker_real)heading, 0.0, own);
    else tracker_begin(&keeper, (tracker_real)noise, (tracker_real)heading, 0.0);
}
void feed(double now, const double *pose, double seen, double *out)
{
    tracker_real own[3] = {0, 0, 0};
    for (int i = 0; i < 3 && pose; i++) own[i] = (tracker_real)pose[i];
    told(tracker_feed(&keeper, now, pose ? own : 0, seen), out);
}
void finish(double *out) { told(tracker_finish_lap(&keeper), out); }
int memory(void) { return (int)sizeof(tracker); }
