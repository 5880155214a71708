/* Poses near the estimate, with flips as they are announced; the same on the microcontroller and here. */
#include <stdio.h>
#include "tracker.h"
#include "schedule.h"
#ifdef __AVR__
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
static int put(char c, FILE *file)
{
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = c;
    return 0;
}
static FILE line = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
#endif
static tracker keeper;
int main(void)
{
    int n, i;
    tracker_advice advice;
#ifdef __AVR__
    UCSR0B = 1 << TXEN0;
    stdout = &line;
#endif
    tracker_begin(&keeper, (tracker_real)0.01, (tracker_real)0.01, 0);
    advice = tracker_feed(&keeper, 0, 0, 0);
    for (n = 0; n < 30; n++) {
        double now = advice.flip_at + 0.0005;
        tracker_real pose[3];
        advice = tracker_feed(&keeper, now, 0, 0);
        for (i = 0; i < 3; i++) pose[i] = keeper.state[i] + (tracker_real)(0.005 * (i - 1));
        if (n % 3 == 2) advice = tracker_feed(&keeper, now, pose, now - 1.0);
        printf("%ld %d %d\n", (long)(advice.flip_at * 1000 + 0.5), advice.direction, (int)schedule_dwell_ms(n));
    }
#ifdef __AVR__
    cli();
    sleep_enable();
    sleep_cpu();
#endif
    return 0;
}
