/* Where the FMU's library was loaded from, for importers that do not tell where the resources are. */
#ifndef HSEP_LIBRARY_H
#define HSEP_LIBRARY_H

#include "hsep_api.h"
#include "hsep_instance.h"

#ifdef HSEP_TABLE_IN_RESOURCES

/* The folder resources/ of an FMU whose library is in binaries/<platform>/, with a trailing slash, UTF-8, in the
 * importer's memory; NULL if the system does not tell where the library is, or there is no memory. */
HSEP_API char *hsep_library_resources(const hsep_instance *instance);

#endif

#endif
