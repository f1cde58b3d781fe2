#include "hsep_resource.h"

#include "hsep_text.h"

#ifndef HSEP_NO_FILES

#ifdef _WIN32
#include <windows.h>
#endif

#define RESOURCE_PATH_SIZE 4096 /* characters */

HSEP_API FILE *hsep_resource_open(const char *folder, const char *name)
{
    char path[RESOURCE_PATH_SIZE];
    if (folder == NULL) {
        return NULL;
    }
    const int length = hsep_text(path, sizeof path, "%s%s", folder, name);
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

HSEP_API size_t hsep_resource_left(FILE *file)
{
    const long here = ftell(file);
    if (here < 0 || fseek(file, 0, SEEK_END) != 0) {
        return 0;
    }
    const long end = ftell(file);
    return end > here && fseek(file, here, SEEK_SET) == 0 ? (size_t)(end - here) : 0;
}

#endif
