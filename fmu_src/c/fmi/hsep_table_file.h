/* The table of one FMU in its resources, where one binary serves all FMUs of a kind (HSEP_TABLE_IN_RESOURCES).
 *
 * The resource variables.bin, little-endian: "HSEPVAR2"; as uint64 the size of the file in bytes, HSEP_INTERFACE, the
 * number of modes, whether the axis is rotary, and the samples of each window, 0 if there is none; the GUID in
 * HSEP_GUID_SIZE bytes, filled with zeros; as doubles the start values of the single variables and of the numbers of
 * the modes; the CRC-32 of all before as uint64.
 *
 * Names, kinds and ranges are the binary's own, so no file can allow what the models do not.
 */
#ifndef HSEP_TABLE_FILE_H
#define HSEP_TABLE_FILE_H

#include "hsep_api.h"
#include "hsep_instance.h"

#define HSEP_GUID_SIZE 48 /* a GUID in braces, padded with zeros */

#ifdef HSEP_TABLE_IN_RESOURCES

#ifdef HSEP_NO_FILES
#error "the table of this FMU is in its resources, which HSEP_NO_FILES leaves out: take the header of a source FMU"
#endif

/* Read the file from the instance's resources; where there is none, from the resources beside the library, which then
 * become the instance's; fill the context, but its resources. Fails if there is none, or it is not one of this binary,
 * damaged or out of a range; HSEP_WARNED: the instance's resources had none. */
HSEP_API hsep_status hsep_table_file_open(hsep_instance *instance, char message[]);

#endif

#endif
