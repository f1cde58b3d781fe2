/* CRC-32 as in zlib. Reentrant. */
#ifndef HSEP_CRC_H
#define HSEP_CRC_H

#include "hsep_api.h"

#include <stddef.h>
#include <stdint.h>

/* Go on with a checksum, 0 at the beginning, by so many bytes. */
HSEP_API uint32_t hsep_crc(uint32_t crc, const void *bytes, size_t size);

#endif
