/* Access to variables by value reference. A call is checked as a whole first: if one variable is refused, none is
 * touched. What fails returns HSEP_REFUSED and says why, call being the name of what the importer called. */
#ifndef HSEP_VALUES_H
#define HSEP_VALUES_H

#include "hsep_api.h"
#include "hsep_instance.h"

#include <stddef.h>

/* What an importer gives to read or write variables. */
typedef struct {
    const char *call;
    const char *type; /* one of the words' types, or of a type that no variable has */
    const unsigned *references;
    size_t n_references;
    const void *values;
    size_t n_values;
} hsep_access;

/* Check that all references are to variables of that type, and that there is a place for each of their values. */
HSEP_API hsep_status hsep_values_check(const hsep_instance *instance, const hsep_access *access, char message[]);

/* Check beside it that they may be set now: inputs at any time, parameters until the initialization has ended, tunable
 * ones later too. */
HSEP_API hsep_status hsep_values_check_set(const hsep_instance *instance, const hsep_access *access, char message[]);

/* Calculate what is read: windows, and what follows from the start values before the initialization has ended. Refused
 * if one of the variables is calculated from a start value that is no position. */
HSEP_API hsep_status hsep_values_prepare(hsep_instance *instance, const hsep_access *access, char message[]);

/* A value as a whole number of 32 bits. */
HSEP_API int hsep_values_integer(double number);

#endif
