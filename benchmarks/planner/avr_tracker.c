/* Times of tracker.h on an AVR, and the memory that it needs: printed by the simulator's serial port. Timer 1 counts
 * 1024 cycles. The stack is painted before each call; what is still painted afterwards was not used. */
#include <stdio.h>
#include "tracker.h"
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

#define FLIPS 60
#define PAINT 0xA5

extern uint8_t __heap_start;
static tracker keeper;

static int put(char c, FILE *file)
{
    (void)file;
    while (!(UCSR0A & (1 << UDRE0))) {}
    UDR0 = c;
    return 0;
}
static FILE line = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

static void __attribute__((noinline)) paint(void)
{
    uint8_t *end = (uint8_t *)(SP - 16);
    for (uint8_t *at = &__heap_start; at < end; at++) *at = PAINT;
}

static unsigned used(uint8_t *from)
{
    uint8_t *at = &__heap_start;
    while (at < from && *at == PAINT) at++;
    return (unsigned)(from - at);
}

static unsigned long ms(uint16_t ticks) { return ticks * 1024UL / (F_CPU / 1000); }

int main(void)
{
    unsigned long flips = 0, poses = 0, way;
    unsigned stack = 0, now_used;
    tracker_advice advice;
    UCSR0B = 1 << TXEN0;
    stdout = &line;
    TCCR1B = 5;
    tracker_begin(&keeper, (tracker_real)0.01, (tracker_real)0.01, 0);
    advice = tracker_feed(&keeper, 0, 0, 0);
    for (int n = 0; n < FLIPS; n++) {
        tracker_real pose[3];
        paint();
        TCNT1 = 0;
        advice = tracker_feed(&keeper, advice.flip_at + 0.0005, 0, 0);
        flips += TCNT1;
        for (int i = 0; i < 3; i++) pose[i] = keeper.state[i] + (tracker_real)(0.005 * (i - 1));
        TCNT1 = 0;
        advice = tracker_feed(&keeper, keeper.now * TRACKER_TIME_SCALE, pose, (keeper.now - 1) * TRACKER_TIME_SCALE);
        poses += TCNT1;
        now_used = used((uint8_t *)SP);
        if (now_used > stack) stack = now_used;
    }
    {
        tracker_real start[3] = {1, -1, 2};
        paint();
        TCNT1 = 0;
        tracker_begin_at(&keeper, (tracker_real)0.01, (tracker_real)0.01, 0, start);
        way = TCNT1;
        now_used = used((uint8_t *)SP);
        if (now_used > stack) stack = now_used;
    }
    printf("flip %lu pose %lu way %lu stack %u\n", ms(flips / FLIPS), ms(poses / FLIPS), ms(way), stack);
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}
