/* Files of the FMU's resources folder: a magic word of 8 bytes, then 8-byte numbers, little-endian. There are none with
 * HSEP_NO_FILES. */
#ifndef HSEP_RESOURCE_H
#define HSEP_RESOURCE_H

#include "hsep_api.h"
#include "hsep_model.h"

#ifndef HSEP_NO_FILES

#include <stdint.h>
#include <stdio.h>

/* Open a file of the resources for reading; NULL if there is no such file, or no resources. To be closed with
 * fclose. The folder's path is UTF-8 on every system. */
HSEP_API FILE *hsep_resource_open(const hsep_context *context, const char *name);

/* Read the magic word and n_head numbers of 8 bytes behind it into head. Returns the number of bytes that follow
 * them in the file, which is then read up to there; -1 if it is not such a file. */
HSEP_API double hsep_resource_head(FILE *file, const char magic[8], uint64_t head[], size_t n_head);

#endif

#endif
