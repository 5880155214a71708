/* It prints the tables of schedule.h. */
#include <stdio.h>
#include "schedule.h"
int main(void)
{
    for (int i = 0; i < SCHEDULE_COUNT; i++) printf("%d ", (int)schedule_dwell_ms(i));
    for (int i = 0; i < SCHEDULE_CHECKPOINTS; i++) {
        schedule_checkpoint c = schedule_checkpoint_at(i);
        printf("%.9g %.9g %.9g %.9g ", (double)c.ms, (double)c.x, (double)c.y, (double)c.heading);
    }
    printf("%ld ", (long)SCHEDULE_TOTAL_MS);
    printf("%.9g %.9g", (double)SCHEDULE_START_X_CM, (double)SCHEDULE_START_HEADING_DEG);
    return 0;
}
