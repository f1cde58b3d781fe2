/* The FMU's resources: their folder, and its files. There are none with HSEP_NO_FILES. */
#ifndef HSEP_RESOURCE_H
#define HSEP_RESOURCE_H

#include "hsep_api.h"

/* Bytes that the folder of a URI of this length needs: a trailing slash and the final 0 are added. */
#define HSEP_FOLDER_SIZE(uri_length) ((uri_length) + 2)

/* Write the folder, percent-decoded (UTF-8 stays as it is) and with a trailing slash; return 1.
 * windows says whether /C:/x means C:/x and //server/share is a place. A text without a scheme is taken as a path, as
 * it is: FMI 3.0's importers give one. Return 0, with nothing to be used in folder, if it is another scheme, another
 * host, or names nothing. */
HSEP_API int hsep_uri_folder(const char *uri, int windows, char *folder);

#ifndef HSEP_NO_FILES

#include <stdio.h>

/* Open a file of the folder, NULL or its path with a trailing slash, UTF-8 on every system, for reading; NULL if there
 * is none. To be closed with fclose. */
HSEP_API FILE *hsep_resource_open(const char *folder, const char *name);

/* Bytes from where the file is read to its end; 0 if that is not known. */
HSEP_API size_t hsep_resource_left(FILE *file);

#endif

#endif
