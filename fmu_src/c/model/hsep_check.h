/* Messages and checks that every model shares, worded as in the Python library.
 * Reentrant; allocates nothing; every message fits into HSEP_MESSAGE_SIZE bytes, cut off at a whole character. */
#ifndef HSEP_CHECK_H
#define HSEP_CHECK_H

#include "hsep_clock.h"
#include "hsep_model.h"

#define HSEP_NUMBER_SIZE 40 /* bytes of a number as text */

/* UTF-8, spelled out for compilers that read sources in another encoding */
#define HSEP_TO "\xe2\x80\xa6"       /* the dots of a range */
#define HSEP_AT_LEAST "\xe2\x89\xa5" /* greater than or equal */
#define HSEP_AT_MOST "\xe2\x89\xa4"  /* less than or equal */
#define HSEP_MINUS "\xe2\x88\x92"
#define HSEP_DOT "\xc2\xb7"
#define HSEP_PLUS_MINUS "\xc2\xb1"

/* Add a problem, formatted as by printf, to a message; "; " goes between two. Return HSEP_REFUSED. */
HSEP_API hsep_status hsep_message_add(char message[], const char *format, ...);

/* Write the shortest decimal number that reads back as value, whole ones of a real with ".0"; return text. */
HSEP_API const char *hsep_number(char text[HSEP_NUMBER_SIZE], double value, hsep_kind kind);

/* The same for a real number, as text that lasts as long as the block that it stands in. */
#define HSEP_SHOWN(value) hsep_number((char[HSEP_NUMBER_SIZE]){0}, value, HSEP_REAL)

/* Check a parameter by itself, by its place in the table; return whether it is in its range, else with a message. */
HSEP_API int hsep_check_parameter(const hsep_context *context, size_t i, double value, char message[]);

/* Check every parameter by itself, the range being the table's; return how many are wrong, each added to message. */
HSEP_API int hsep_check_parameters(const hsep_context *context, const double values[], char message[]);

/* Check that a position, m or rad, is finite and as near as machines are. where: format of at, the message's end. */
HSEP_API hsep_status hsep_check_position(
    const hsep_context *context, const char *name, double value, const char *where, double at, char message[]);

/* Turn a size that was counted in double into bytes. Fails if it is more than memory can be asked for. */
HSEP_API hsep_status hsep_check_bytes(double bytes, size_t *size, char message[]);

/* Check that a state has memory of the size that it needs: a resource may have changed since that was told. */
HSEP_API hsep_status hsep_check_memory(size_t needed, size_t size, char message[]);

/* Check that the simulation starts at a number. */
HSEP_API hsep_status hsep_check_start_time(double t_start, char message[]);

/* Check the start time and begin to count samples of T_s, s, from there. */
HSEP_API hsep_status hsep_check_clock(hsep_clock *clock, double t_start, double T_s, char message[]);

/* Check the size of a communication step, s. */
HSEP_API hsep_status hsep_check_step_size(double h, char message[]);

/* Check that a step begins at t where the last one ended, at end, s; tolerance as in hsep_clock_follows. */
HSEP_API hsep_status hsep_check_point(double end, double t, double tolerance, char message[]);

/* Check that the step from t by h, s, comes next, and count it. */
HSEP_API hsep_status
hsep_check_step(const hsep_clock *clock, double t, double h, hsep_clock_step *step, char message[]);

/* HSEP_WARNED_MOVED, with a message, where a step has taken an instant at its end that lies beside it; else HSEP_OK. */
HSEP_API hsep_status hsep_check_moved(const hsep_clock_step *step, char message[]);

#endif
