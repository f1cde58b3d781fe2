/* Opening of an instance: its name, its resources and the table of its variables. */
#ifndef HSEP_OPENING_H
#define HSEP_OPENING_H

#include "hsep_api.h"
#include "hsep_instance.h"

/* Keep name and resources, a URI, a path or NULL, and take the table of the FMU's variables and what was learned: from
 * the header, or from variables.bin and weights.bin of the resources, which are the resources beside the library where
 * the location leads to none. Fails if there is no memory, or no table, or it is not one of this binary, damaged or out
 * of a range; HSEP_WARNED: the location is not used. */
HSEP_API hsep_status hsep_open(hsep_instance *instance, const char *name, const char *resources, char message[]);

#endif
