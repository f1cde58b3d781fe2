#include "hsep_library.h"

#ifdef HSEP_TABLE_IN_RESOURCES

#include <string.h>

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h> /* dladdr, which is no part of POSIX: _GNU_SOURCE is defined by the compiler's options */
#endif

#define LIBRARY_PATH_SIZE 4096 /* bytes, and characters */
#define LIBRARY_UP "../../resources/"

static const char library_here = 0; /* an address in this library */

/* Write the library's own path to path; 0 if the system does not tell. */
static int library_path(char path[LIBRARY_PATH_SIZE])
{
#ifdef _WIN32
    wchar_t wide[LIBRARY_PATH_SIZE];
    HMODULE module = NULL;
    const DWORD flags = GET_MODULE_HANDLE_EX_FLAG_FROM_ADDRESS | GET_MODULE_HANDLE_EX_FLAG_UNCHANGED_REFCOUNT;
    if (!GetModuleHandleExW(flags, (const wchar_t *)(const void *)&library_here, &module)) {
        return 0;
    }
    const DWORD length = GetModuleFileNameW(module, wide, LIBRARY_PATH_SIZE);
    return length > 0 && length < LIBRARY_PATH_SIZE &&
           WideCharToMultiByte(CP_UTF8, 0, wide, -1, path, LIBRARY_PATH_SIZE, NULL, NULL) > 0;
#else
    Dl_info info;
    if (dladdr(&library_here, &info) == 0 || info.dli_fname == NULL || strlen(info.dli_fname) >= LIBRARY_PATH_SIZE) {
        return 0;
    }
    (void)strcpy(path, info.dli_fname);
    return 1;
#endif
}

HSEP_API char *hsep_library_resources(const hsep_instance *instance)
{
    char path[LIBRARY_PATH_SIZE];
    if (!library_path(path)) {
        return NULL;
    }
    size_t end = strlen(path);
#ifdef _WIN32
    while (end > 0 && path[end - 1] != '/' && path[end - 1] != '\\') {
#else
    while (end > 0 && path[end - 1] != '/') {
#endif
        end--;
    }
    char *folder = hsep_new(instance, end + sizeof LIBRARY_UP);
    if (folder != NULL) {
        memcpy(folder, path, end);
        memcpy(folder + end, LIBRARY_UP, sizeof LIBRARY_UP);
    }
    return folder;
}

#else
typedef int hsep_no_library; /* a translation unit must not be empty */
#endif
