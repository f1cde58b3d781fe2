/* The text of numbers as the tests reach it, by functions that take no list of arguments. */
#include "hsep_text.h"

#include <stdint.h>

int text_real(char to[], size_t size, const char *format, int precision, double value);
int text_others(char to[], size_t size, const char *text, int number, unsigned long large);

/* format: with one or two stars, %.*g. */
int text_real(char to[], size_t size, const char *format, int precision, double value)
{
    return hsep_text(to, size, format, precision, value);
}

int text_others(char to[], size_t size, const char *text, int number, unsigned long large)
{
    return hsep_text(to, size, "%.3s|%s|%d|%lu|%u", text, text, number, large, (unsigned)large);
}
