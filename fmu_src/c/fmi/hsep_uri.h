/* Conversion of the URI of an FMU's resources to a path for fopen. */
#ifndef HSEP_URI_H
#define HSEP_URI_H

#include "hsep_api.h"

/* Bytes that the folder of a URI of this length needs: a trailing slash and the final 0 are added. */
#define HSEP_FOLDER_SIZE(uri_length) ((uri_length) + 2)

/* Write the folder, percent-decoded (UTF-8 stays as it is) and with a trailing slash; return 1.
 * windows says whether /C:/x means C:/x and //server/share is a place. A text without a scheme is taken as a path, as
 * it is: FMI 3.0's importers give one. Return 0, with nothing to be used in folder, if it is another scheme, another
 * host, or names nothing. */
HSEP_API int hsep_uri_folder(const char *uri, int windows, char *folder);

#endif
