#include "hsep_check.h"

#include "hsep_table.h"
#include "hsep_text.h"

#include <stdarg.h>

static const double check_position_max[] = {1e3, 1e6}; /* m; rad, as a rotary axis may turn on and on */

HSEP_API hsep_status hsep_message_add(char message[], const char *format, ...)
{
    size_t used = strlen(message);
    if (used > 0 && used + 2 < HSEP_MESSAGE_SIZE) {
        memcpy(message + used, "; ", 3);
        used += 2;
    }
    va_list arguments;
    va_start(arguments, format);
    const int wanted = hsep_text_list(message + used, HSEP_MESSAGE_SIZE - used, format, arguments);
    va_end(arguments);
    if (wanted < 0) {
        message[used] = '\0';
    } else if ((size_t)wanted >= HSEP_MESSAGE_SIZE - used) {
        /* Cut off: take back an incomplete UTF-8 character, its following bytes (10xxxxxx) and its first one. */
        size_t end = HSEP_MESSAGE_SIZE - 1;
        message[end] = '\0';
        while (end > used && ((unsigned char)message[end - 1] & 0xC0) == 0x80) {
            message[--end] = '\0';
        }
        if (end > used && (unsigned char)message[end - 1] >= 0xC0) {
            message[end - 1] = '\0';
        }
    }
    return HSEP_REFUSED;
}

HSEP_API const char *hsep_number(char text[HSEP_NUMBER_SIZE], double value, hsep_kind kind)
{
    if (!isfinite(value)) {
        memcpy(text, isnan(value) ? "nan\0" : value > 0.0 ? "inf\0" : "-inf", 5);
        return text;
    }
    int exponent = 0;
    const int digits = hsep_text_digits(value, &exponent), decimals = digits > exponent ? digits - exponent : 0;
    if (exponent >= -4 && exponent < 16) {
        hsep_text(text, HSEP_NUMBER_SIZE, "%.*f", decimals > 0 || kind != HSEP_REAL ? decimals : 1, value);
    } else {
        hsep_text(text, HSEP_NUMBER_SIZE, "%.*e", digits, value);
    }
    return text;
}

/* Write the allowed range of a parameter, with its unit. */
static void check_range_text(char text[], size_t size, const hsep_variable *v, const char *unit)
{
    const char *space = unit[0] != '\0' ? " " : "";
    const char *zero = v->nonzero > 0.0 ? "0 or " : "";
    char automatic[HSEP_NUMBER_SIZE] = "";
    if (isfinite(v->automatic)) {
        hsep_text(automatic, sizeof automatic, "%g (automatic) or ", v->automatic);
    }
    hsep_text(
        text, size, "%s%s%g " HSEP_TO " %.10g%s%s", automatic, zero, v->nonzero > 0.0 ? v->nonzero : v->minimum,
        v->maximum, space, unit);
}

HSEP_API int hsep_check_parameter(const hsep_context *context, size_t i, double value, char message[])
{
    char number[HSEP_NUMBER_SIZE], name[HSEP_NAME_SIZE], range[96];
    const hsep_variable *v = hsep_table_row(context, i);
    const int whole = v->kind == HSEP_INTEGER || v->kind == HSEP_ENUMERATION;
    const int tiny = value != 0.0 && fabs(value) < v->nonzero;
    const int within = (value >= v->minimum && value <= v->maximum && !tiny) || value == v->automatic;
    const char *must = !isfinite(value)                 ? "finite"
                       : whole && value != floor(value) ? "a whole number"
                       : !within                        ? range
                                                        : NULL;
    if (must == NULL) {
        return 1;
    }
    check_range_text(range, sizeof range, v, context->angular ? v->angular_unit : v->unit);
    hsep_message_add(
        message, "%s must be %s, got %s", hsep_table_name(context, i, name), must, hsep_number(number, value, v->kind));
    return 0;
}

HSEP_API int hsep_check_parameters(const hsep_context *context, const double values[], char message[])
{
    int problems = 0;
    for (size_t i = 0; i < context->n_variables; i++) {
        const int is_parameter = hsep_table_row(context, i)->causality == HSEP_PARAMETER;
        problems += is_parameter && !hsep_check_parameter(context, i, values[i], message);
    }
    return problems;
}

HSEP_API hsep_status hsep_check_position(
    const hsep_context *context, const char *name, double value, const char *where, double at, char message[])
{
    const double most = check_position_max[context->angular != 0];
    char end[HSEP_NUMBER_SIZE];
    if (fabs(value) <= most) {
        return HSEP_OK;
    }
    hsep_text(end, sizeof end, where, at);
    if (isfinite(value)) {
        hsep_message_add(
            message, "%s must be within " HSEP_PLUS_MINUS "%g %s, got %g%s", name, most, context->angular ? "rad" : "m",
            value, end);
    } else {
        hsep_message_add(message, "%s must be finite, got %s%s", name, HSEP_SHOWN(value), end);
    }
    return HSEP_REFUSED;
}

HSEP_API hsep_status hsep_check_bytes(double bytes, size_t *size, char message[])
{
    if (!(bytes < 0.5 * (double)SIZE_MAX)) {
        return hsep_message_add(
            message, "the state must fit into memory, got %.4g bytes for these parameters; lower Np, p or q", bytes);
    }
    *size = (size_t)bytes;
    return HSEP_OK;
}

HSEP_API hsep_status hsep_check_memory(size_t needed, size_t size, char message[])
{
    if (needed != size) {
        return hsep_message_add(
            message,
            "the state must have %.0f bytes, got memory for %.0f; its file in the resources has changed meanwhile: "
            "initialise again",
            (double)needed, (double)size);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_check_start_time(double t_start, char message[])
{
    if (isfinite(t_start)) {
        return HSEP_OK;
    }
    return hsep_message_add(message, "the start time must be finite, got %s s", HSEP_SHOWN(t_start));
}

HSEP_API hsep_status hsep_check_clock(hsep_clock *clock, double t_start, double T_s, char message[])
{
    if (hsep_check_start_time(t_start, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!hsep_clock_init(clock, t_start, T_s)) {
        return hsep_message_add(
            message, "the start time must be small enough to resolve samples of T_s = %g s, got %g s", T_s, t_start);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_check_step_size(double h, char message[])
{
    if (h > 0.0 && h <= HSEP_CLOCK_STEP_MAX) {
        return HSEP_OK;
    }
    return hsep_message_add(
        message, "the communication step size must be > 0 and " HSEP_AT_MOST " %g s, got %s", HSEP_CLOCK_STEP_MAX,
        HSEP_SHOWN(h));
}

HSEP_API hsep_status hsep_check_point(double end, double t, double tolerance, char message[])
{
    if (hsep_clock_follows(end, t, tolerance)) {
        return HSEP_OK;
    }
    return hsep_message_add(
        message, "the communication point must be %s s, where the last step ended, got %s s", HSEP_SHOWN(end),
        HSEP_SHOWN(t));
}

HSEP_API hsep_status hsep_check_step(const hsep_clock *clock, double t, double h, hsep_clock_step *step, char message[])
{
    if (hsep_check_step_size(h, message) != HSEP_OK) {
        return HSEP_REFUSED;
    }
    if (!hsep_clock_count(clock, t, h, step)) {
        return hsep_check_point(clock->end, t, 0.5 * clock->T_s, message);
    }
    return HSEP_OK;
}

HSEP_API hsep_status hsep_check_moved(const hsep_clock_step *step, char message[])
{
    const hsep_clock *clock = &step->after;
    if (!step->noticed) {
        return HSEP_OK;
    }
    hsep_message_add(
        message,
        "the communication point %.9g s is %.2g samples of T_s = %g s %s a sampling instant, which is taken there: "
        "samples follow the importer's points; a model of T_s needs steps of T_s",
        clock->end, fabs(step->moved) / clock->T_s, clock->T_s, step->moved > 0.0 ? "behind" : "before");
    return HSEP_WARNED_MOVED;
}
