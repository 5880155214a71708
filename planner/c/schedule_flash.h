/* Read the tables with schedule_dwell_ms(i) and schedule_checkpoint_at(i). The arrays schedule_ms and
 * schedule_checkpoints may be used directly as well, but not on AVR: there they are in flash, under other names. */
#ifndef __AVR__
#define SCHEDULE_TABLE(name) name
#define SCHEDULE_FLASH
#define SCHEDULE_COPY(to, name, index) (*(to) = name[index])
#else
#include <avr/pgmspace.h>
#define SCHEDULE_TABLE(name) name##_in_flash
#define SCHEDULE_FLASH PROGMEM
#ifdef __AVR_HAVE_ELPM__ /* more than 64 kB of flash: far addresses */
#define SCHEDULE_COPY(to, name, index) \
    memcpy_PF(to, pgm_get_far_address(name##_in_flash) + (uint_farptr_t)(index) * sizeof *(to), sizeof *(to))
#else
#define SCHEDULE_COPY(to, name, index) memcpy_P(to, &name##_in_flash[index], sizeof *(to))
#endif
#endif
