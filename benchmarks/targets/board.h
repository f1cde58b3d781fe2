/* What a replay needs of the machine that it runs on: a processor without an operating system, or this one. */
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

/* Prepare the counter. */
void board_init(void);

/* Instructions so far, in units that the benchmark knows for each board; it may begin anew at 2^32. */
uint32_t board_count(void);

/* Write a text, ended by 0, to whoever runs the program. */
void board_write(const char *text);

#endif
