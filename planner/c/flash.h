/* ---- where the tables are ------------------------------------------------------------------------------------ */

/* Tables are plain constants. On AVR they are in flash and are read through macros: a constant would be in RAM. For
 * another memory define TRACKER_FLASH, TRACKER_SHORT and TRACKER_REAL before you include this file. An AVR object has
 * at most 32767 bytes, so each table has one index. */
#ifndef TRACKER_FLASH
#ifndef __AVR__
#define TRACKER_FLASH
#define TRACKER_SHORT(table, index) ((table)[index])
#define TRACKER_REAL(table, index) ((table)[index])
#else
#include <avr/pgmspace.h>
#define TRACKER_FLASH PROGMEM
#ifdef __AVR_HAVE_ELPM__ /* more than 64 kB of flash: far addresses */
static tracker_real tracker_real_at(uint_farptr_t address)
{
    tracker_real value;
    memcpy_PF(&value, address, sizeof value);
    return value;
}
#define TRACKER_PLACE(table, index) (pgm_get_far_address(table) + (uint_farptr_t)(index) * sizeof(table[0]))
#define TRACKER_SHORT(table, index) ((int16_t)pgm_read_word_far(TRACKER_PLACE(table, index)))
#else
static tracker_real tracker_real_at(const tracker_real *address)
{
    tracker_real value;
    memcpy_P(&value, address, sizeof value);
    return value;
}
#define TRACKER_PLACE(table, index) (&(table)[index])
#define TRACKER_SHORT(table, index) ((int16_t)pgm_read_word(TRACKER_PLACE(table, index)))
#endif
#define TRACKER_REAL(table, index) tracker_real_at(TRACKER_PLACE(table, index))
#endif
#endif

