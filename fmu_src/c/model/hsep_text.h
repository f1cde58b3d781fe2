/* Text of messages, by snprintf; with HSEP_NO_STDIO by a part of it that needs no C library: %d, %lu, %s with a
 * precision, and numbers, whole ones with all their digits, others with seven. Reentrant; allocates nothing. */
#ifndef HSEP_TEXT_H
#define HSEP_TEXT_H

#include "hsep_api.h"

#include <stdarg.h>
#include <stddef.h>

/* As snprintf and vsnprintf. */
HSEP_API int hsep_text(char to[], size_t size, const char *format, ...);
HSEP_API int hsep_text_list(char to[], size_t size, const char *format, va_list arguments);

/* Digits after the first one of the shortest decimal number that reads back as value, which is finite, and its power
 * of ten; with HSEP_NO_STDIO 0, as numbers are written alike there. */
HSEP_API int hsep_text_digits(double value, int *exponent);

#endif
