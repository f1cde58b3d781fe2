#include "hsep_text.h"

#ifndef HSEP_NO_STDIO

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

HSEP_API int hsep_text_list(char to[], size_t size, const char *format, va_list arguments)
{
    return vsnprintf(to, size, format, arguments);
}

HSEP_API int hsep_text_digits(double value, int *exponent)
{
    char text[40];
    int digits = 0;
    do {
        snprintf(text, sizeof text, "%.*e", digits, value);
    } while (strtod(text, NULL) != value && ++digits < 17); /* 17 digits always do */
    const char *mark = strchr(text, 'e');
    *exponent = mark != NULL ? (int)strtol(mark + 1, NULL, 10) : 0;
    return digits;
}

#else

#include <math.h>
#include <stdint.h>

/* Where text goes; n counts on where there is no room. */
typedef struct {
    char *to;
    size_t size, n;
} text_sink;

static void text_put(text_sink *sink, char c)
{
    if (sink->n + 1 < sink->size) {
        sink->to[sink->n] = c;
    }
    sink->n++;
}

/* Put a whole number with at least this many digits. */
static void text_put_whole(text_sink *sink, uint64_t number, int least)
{
    char digits[24];
    int n = 0;
    for (; number > 0 || n < least; number /= 10) {
        digits[n++] = (char)('0' + (int)(number % 10));
    }
    while (n > 0) {
        text_put(sink, digits[--n]);
    }
}

HSEP_API int hsep_text_digits(double value, int *exponent)
{
    (void)value;
    *exponent = 0;
    return 0;
}

/* Put a number, whole ones with all their digits, others as a power of ten with at most seven. */
static void text_put_number(text_sink *sink, double value)
{
    int exponent = 0, decimals = 6;
    uint64_t unit = 1000000; /* 10^decimals */
    if (!isfinite(value)) {
        for (const char *c = isnan(value) ? "nan" : value > 0.0 ? "inf" : "-inf"; *c != '\0'; c++) {
            text_put(sink, *c);
        }
        return;
    }
    if (signbit(value)) {
        text_put(sink, '-');
        value = -value;
    }
    if (value < 1e15 && value == floor(value)) {
        text_put_whole(sink, (uint64_t)value, 1);
        return;
    }
    for (; value >= 10.0; exponent++) {
        value /= 10.0;
    }
    for (; value < 1.0; exponent--) {
        value *= 10.0;
    }
    uint64_t number = (uint64_t)(value * (double)unit + 0.5);
    for (; decimals > 0 && number % 10 == 0; decimals--) {
        number /= 10;
        unit /= 10;
    }
    text_put_whole(sink, number / unit, 1);
    if (decimals > 0) {
        text_put(sink, '.');
        text_put_whole(sink, number % unit, decimals);
    }
    text_put(sink, 'e');
    text_put(sink, exponent < 0 ? '-' : '+');
    text_put_whole(sink, (uint64_t)(exponent < 0 ? -exponent : exponent), 2);
}

HSEP_API int hsep_text_list(char to[], size_t size, const char *format, va_list arguments)
{
    text_sink sink = {to, size, 0};
    for (; *format != '\0'; format++) {
        int precision = -1;
        if (*format != '%') {
            text_put(&sink, *format);
            continue;
        }
        if (*++format == '.') {
            precision = 0;
            if (*++format == '*') {
                precision = va_arg(arguments, int);
                format++;
            }
            for (; *format >= '0' && *format <= '9'; format++) {
                precision = 10 * precision + (*format - '0');
            }
        }
        if (*format == 's') {
            const char *text = va_arg(arguments, const char *);
            for (int i = 0; text[i] != '\0' && i != precision; i++) {
                text_put(&sink, text[i]);
            }
        } else if (*format == 'd') {
            const int number = va_arg(arguments, int);
            if (number < 0) {
                text_put(&sink, '-');
            }
            text_put_whole(&sink, number < 0 ? (uint64_t)-(int64_t)number : (uint64_t)number, 1);
        } else if (*format == 'l') { /* %lu */
            format++;
            text_put_whole(&sink, va_arg(arguments, unsigned long), 1);
        } else if (*format == 'u') {
            text_put_whole(&sink, va_arg(arguments, unsigned), 1);
        } else {
            text_put_number(&sink, va_arg(arguments, double));
        }
    }
    if (size > 0) {
        to[sink.n < size ? sink.n : size - 1] = '\0';
    }
    return (int)sink.n;
}

#endif

HSEP_API int hsep_text(char to[], size_t size, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int wanted = hsep_text_list(to, size, format, arguments);
    va_end(arguments);
    return wanted;
}
