/* Access to variables by value reference. A call is checked as a whole first: if one variable is refused, none is
 * touched. What fails returns HSEP_REFUSED and says why, call being the name of what the importer called. */
#ifndef HSEP_VALUES_H
#define HSEP_VALUES_H

#include "hsep_api.h"
#include "hsep_instance.h"

#include <stddef.h>

/* Check that there are n references, all to variables of that kind, and a place for their values. */
HSEP_API hsep_status hsep_values_check(
    const hsep_instance *instance, const char *call, hsep_kind kind, const unsigned vr[], size_t n, const void *value,
    char message[]);

/* Check beside it that they may be set now: inputs at any time, parameters until the initialization has ended, tunable
 * ones later too. reset: name of the call after which the others may be. */
HSEP_API hsep_status hsep_values_check_set(
    const hsep_instance *instance, const char *call, const char *reset, const unsigned vr[], size_t n, char message[]);

/* Calculate what is read before the initialization has ended: it follows from the start values. Refused if one of the n
 * is calculated from a start value that is no position. */
HSEP_API hsep_status
hsep_values_prepare(hsep_instance *instance, const char *call, const unsigned vr[], size_t n, char message[]);

/* A value as a whole number of 32 bits. */
HSEP_API int hsep_values_integer(double number);

#endif
