#include "hsep_resource.h"

#ifndef HSEP_NO_FILES

#include "hsep_text.h"

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
    const int length = hsep_text(path, sizeof path, "%s%s", context->resources, name);
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

#else
typedef int hsep_no_resource; /* a translation unit must not be empty */
#endif
