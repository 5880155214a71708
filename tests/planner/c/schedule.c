/* It prints the tables of schedule.h in whole numbers, one a line; an AVR does so on its serial port. */
#include <stdio.h>
#include "schedule.h"
#ifdef __AVR_ARCH__ /* not the pretended one */
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
static void tell(double value) { printf("= %ld\n", (long)(value < 0 ? value - 0.5 : value + 0.5)); }
int main(void)
{
#ifdef __AVR_ARCH__
    UCSR0B = 1 << TXEN0;
    stdout = &line;
#endif
    for (int i = 0; i < SCHEDULE_COUNT; i++) tell(schedule_dwell_ms(i));
    for (int i = 0; i < SCHEDULE_CHECKPOINTS; i++) {
        schedule_checkpoint c = schedule_checkpoint_at(i);
        printf("= %ld\n", (long)c.ms);
        tell(1e5 * c.x);
        tell(1e5 * c.y);
        tell(1e5 * c.heading);
    }
    printf("= %ld\n", (long)SCHEDULE_TOTAL_MS);
    tell(1e4 * SCHEDULE_START_X_CM);
    tell(1e3 * SCHEDULE_START_HEADING_DEG);
#ifdef __AVR_ARCH__
    cli();
    sleep_enable();
    sleep_cpu();
#endif
    return 0;
}
