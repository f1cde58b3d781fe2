/* CRC-32 as in zlib. Reentrant. */
#ifndef HSEP_CRC_H
#define HSEP_CRC_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* The checksum of size bytes, 4 bits at a time. */
static inline uint32_t hsep_crc(const void *bytes, size_t size)
{
    static const uint32_t table[16] = {0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
                                       0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
                                       0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU};
    const unsigned char *byte = bytes;
    uint32_t crc = 0xFFFFFFFFU;
    for (size_t i = 0; i < size; i++) {
        crc ^= byte[i];
        crc = (crc >> 4) ^ table[crc & 15U];
        crc = (crc >> 4) ^ table[crc & 15U];
    }
    return ~crc;
}

/* Whether the last 8 bytes are the checksum of the others. */
static inline int hsep_is_sealed(const void *bytes, size_t size)
{
    uint64_t sum = 0;
    if (size < sizeof sum) {
        return 0;
    }
    memcpy(&sum, (const char *)bytes + size - sizeof sum, sizeof sum);
    return sum == hsep_crc(bytes, size - sizeof sum);
}

#endif
