/* Flash as an AVR has it, pretended on a PC: reading a table without the functions of this file gives nonsense.
 *
 * Tables of PROGMEM are in a section of their own. Before main its content moves to another place, from which the
 * functions read, and the section is filled with 0xA5. */
#ifndef FAKE_PGMSPACE_H
#define FAKE_PGMSPACE_H
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#define PROGMEM __attribute__((section("flash"), used))
typedef uintptr_t uint_farptr_t;
#define pgm_get_far_address(table) ((uint_farptr_t) & (table))

extern const char __start_flash[] __attribute__((visibility("hidden")));
extern const char __stop_flash[] __attribute__((visibility("hidden")));
static const char *flash_content;

__attribute__((constructor)) static void flash_moves(void)
{
    uintptr_t start = (uintptr_t)__start_flash, stop = (uintptr_t)__stop_flash, page = (uintptr_t)getpagesize();
    uintptr_t low = start / page * page;
    char *kept = (char *)malloc(stop - start);
    memcpy(kept, (const void *)start, stop - start);
    if (mprotect((void *)low, stop - low, PROT_READ | PROT_WRITE)) abort();
    memset((void *)start, 0xA5, stop - start);
    flash_content = kept;
}

static inline void *memcpy_PF(void *to, uint_farptr_t from, size_t count)
{
    return memcpy(to, flash_content + (from - (uintptr_t)__start_flash), count);
}
static inline void *memcpy_P(void *to, const void *from, size_t count)
{
    return memcpy_PF(to, (uint_farptr_t)from, count);
}
#endif
