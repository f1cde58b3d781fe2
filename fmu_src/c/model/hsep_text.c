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

#define TEXT_DIGITS 17 /* of a double */

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

/* Put a whole number with at least so many digits. */
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

/* 10^n, n >= 0; exact up to 22. */
static double text_power(int n)
{
    double power = 1.0;
    for (int i = 0; i < n; i++) {
        power *= 10.0;
    }
    return power;
}

/* value 10^n; in two steps where the power would overflow. */
static double text_scaled(double value, int n)
{
    const int first = n < -300 ? -300 : n > 300 ? 300 : n, second = n - first;
    value = first < 0 ? value / text_power(-first) : value * text_power(first);
    return second < 0 ? value / text_power(-second) : value * text_power(second);
}

/* Round value > 0 to so many digits, 1 ... TEXT_DIGITS, a whole number; exponent: of the first one. */
static uint64_t text_decimal(double value, int digits, int *exponent)
{
    int e = (int)floor(log10(value));
    while (text_scaled(1.0, e) > value) {
        e--;
    }
    while (text_scaled(1.0, e + 1) <= value) {
        e++;
    }
    uint64_t number = (uint64_t)floor(text_scaled(value, digits - 1 - e) + 0.5);
    if ((double)number >= text_power(digits)) {
        number /= 10;
        e++;
    }
    *exponent = e;
    return number;
}

HSEP_API int hsep_text_digits(double value, int *exponent)
{
    int digits = 0;
    *exponent = 0;
    for (value = fabs(value); value > 0.0; digits++) {
        const uint64_t number = text_decimal(value, digits + 1, exponent);
        if (digits + 1 == TEXT_DIGITS || text_scaled((double)number, *exponent - digits) == value) {
            break;
        }
    }
    return digits;
}

/* Put value >= 0 with so many digits behind the point; digits behind the 17th are 0. */
static void text_put_fixed(text_sink *sink, double value, int decimals)
{
    int exponent = 0, zeros = 0;   /* zeros: of the whole part, for which number has no room */
    uint64_t number = 0, unit = 1; /* number: value 10^decimals, and unit 10^decimals */
    if (value > 0.0) {
        (void)text_decimal(value, TEXT_DIGITS, &exponent);
        const int wanted = exponent + 1 + decimals, digits = wanted < TEXT_DIGITS ? wanted : TEXT_DIGITS;
        number = (uint64_t)floor(text_scaled(value, digits > 0 ? digits - 1 - exponent : decimals) + 0.5);
        zeros = digits > 0 && wanted > digits ? wanted - digits : 0;
        for (; zeros > 0 && number < UINT64_MAX / 10; zeros--) {
            number *= 10;
        }
    }
    for (int i = 0; i < decimals; i++) {
        unit *= 10;
    }
    text_put_whole(sink, number / unit, 1);
    for (; zeros > 0; zeros--) {
        text_put(sink, '0');
    }
    if (decimals > 0) {
        text_put(sink, '.');
        text_put_whole(sink, number % unit, decimals);
    }
}

/* Put number 10^(exponent - digits) as a power of ten, with so many digits behind the first one. */
static void text_put_power(text_sink *sink, uint64_t number, int exponent, int digits)
{
    const uint64_t unit = (uint64_t)text_power(digits);
    text_put_whole(sink, number / unit, 1);
    if (digits > 0) {
        text_put(sink, '.');
        text_put_whole(sink, number % unit, digits);
    }
    text_put(sink, 'e');
    text_put(sink, exponent < 0 ? '-' : '+');
    text_put_whole(sink, (uint64_t)(exponent < 0 ? -exponent : exponent), 2);
}

/* Put value >= 0 with so many digits, as %g does: without zeros at the end. */
static void text_put_general(text_sink *sink, double value, int digits)
{
    digits = digits > 0 ? digits : 1;
    int exponent = 0, needed = digits - 1;
    uint64_t number = value > 0.0 ? text_decimal(value, needed + 1, &exponent) : 0;
    while (needed > 0 && number % 10 == 0) {
        number /= 10;
        needed--;
    }
    if (exponent < -4 || exponent >= digits) {
        text_put_power(sink, number, exponent, needed);
    } else {
        text_put_fixed(
            sink, value > 0.0 ? text_scaled((double)number, exponent - needed) : 0.0,
            needed > exponent ? needed - exponent : 0);
    }
}

static void text_put_number(text_sink *sink, char conversion, double value, int precision)
{
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
    precision = precision < 0 ? 6 : precision < TEXT_DIGITS ? precision : TEXT_DIGITS;
    if (conversion == 'f') {
        text_put_fixed(sink, value, precision);
    } else if (conversion == 'e') {
        const int digits = precision < TEXT_DIGITS ? precision : TEXT_DIGITS - 1;
        int exponent = 0;
        const uint64_t number = value > 0.0 ? text_decimal(value, digits + 1, &exponent) : 0;
        text_put_power(sink, number, exponent, digits);
    } else {
        text_put_general(sink, value, precision);
    }
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
            text_put_number(&sink, *format, va_arg(arguments, double), precision);
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
