/* Files of the FMU's resources folder. There are none with HSEP_NO_FILES. */
#ifndef HSEP_RESOURCE_H
#define HSEP_RESOURCE_H

#include "hsep_api.h"

#ifndef HSEP_NO_FILES

#include <stdio.h>

/* Open a file of the folder, NULL or its path with a trailing slash, UTF-8 on every system, for reading; NULL if there
 * is none. To be closed with fclose. */
HSEP_API FILE *hsep_resource_open(const char *folder, const char *name);

/* Bytes from where the file is read to its end; 0 if that is not known. */
HSEP_API size_t hsep_resource_left(FILE *file);

#endif

#endif
