#include "hsep_resource.h"

#include <string.h>

#ifdef _WIN32
#include <windows.h>
#endif

#define RESOURCE_PATH_SIZE 4096 /* characters */

HSEP_API FILE *hsep_resource_open(const hsep_context *context, const char *name)
{
    char path[RESOURCE_PATH_SIZE];
    if (context->resources == NULL) {
        return NULL;
    }
    const int length = snprintf(path, sizeof path, "%s%s", context->resources, name);
    if (length < 0 || (size_t)length >= sizeof path) {
        return NULL;
    }
#ifdef _WIN32
    wchar_t wide[RESOURCE_PATH_SIZE];
    if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, RESOURCE_PATH_SIZE) == 0) {
        return NULL;
    }
    return _wfopen(wide, L"rb");
#else
    return fopen(path, "rb");
#endif
}

HSEP_API double hsep_resource_head(FILE *file, const char magic[8], uint64_t head[], size_t n_head)
{
    char found[8];
    if (fread(found, 1, sizeof found, file) != sizeof found || memcmp(found, magic, sizeof found) != 0 ||
        fread(head, sizeof *head, n_head, file) != n_head) {
        return -1.0;
    }
    const long here = ftell(file);
    if (here < 0 || fseek(file, 0, SEEK_END) != 0) {
        return -1.0;
    }
    const long end = ftell(file);
    if (end < here || fseek(file, here, SEEK_SET) != 0) {
        return -1.0;
    }
    return (double)(end - here);
}

/* CRC-32 as in zlib, 4 bits at a time. */
HSEP_API uint32_t hsep_crc(uint32_t crc, const void *bytes, size_t size)
{
    static const uint32_t table[16] = {0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
                                       0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
                                       0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU};
    const unsigned char *byte = bytes;
    crc = ~crc;
    for (size_t i = 0; i < size; i++) {
        crc ^= byte[i];
        crc = (crc >> 4) ^ table[crc & 15U];
        crc = (crc >> 4) ^ table[crc & 15U];
    }
    return ~crc;
}
