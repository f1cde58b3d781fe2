/* Numbers as hexadecimal digits, for programs without printf. */
#ifndef HEXADECIMAL_H
#define HEXADECIMAL_H

#include "board.h"

#include <string.h>

/* Write so many digits of a number, at most 16. */
static inline void write_hexadecimal(uint64_t number, int digits)
{
    char text[17];
    text[digits] = '\0';
    for (int i = digits; i-- > 0; number >>= 4) {
        text[i] = "0123456789abcdef"[number & 15];
    }
    board_write(text);
}

/* Write the bits of a double behind a space. */
static inline void write_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    board_write(" ");
    write_hexadecimal(bits, 16);
}

#endif
