#include "hsep_resource.h"

#include "hsep_text.h"

#include <string.h>

/* RFC 8089 file URIs as importers write them: file:///a/b, file:/a/b, file://localhost/a/b, file:///C:/a/b. */

/* Whether text begins with prefix, which is written in lower case. */
static int resource_begins(const char *text, const char *prefix)
{
    for (; *prefix != '\0'; ++text, ++prefix) {
        const char lower = (*text >= 'A' && *text <= 'Z') ? (char)(*text - 'A' + 'a') : *text;
        if (lower != *prefix) {
            return 0;
        }
    }
    return 1;
}

/* The number of a hexadecimal digit, or -1. */
static int resource_digit(char c)
{
    static const char digits[] = "0123456789abcdef0123456789ABCDEF";
    const char *place = (c == '\0') ? NULL : strchr(digits, c);
    return (place == NULL) ? -1 : (int)((place - digits) % 16);
}

/* Append the decoded text; a percent sign that begins no pair of digits is kept. Return NULL at an encoded 0. */
static char *resource_decode(const char *text, char *end)
{
    while (*text != '\0') {
        const int high = (*text == '%') ? resource_digit(text[1]) : -1;
        const int low = (high >= 0) ? resource_digit(text[2]) : -1;
        if (low < 0) {
            *end++ = *text++;
            continue;
        }
        if (high == 0 && low == 0) {
            return NULL;
        }
        *end++ = (char)(unsigned char)(16 * high + low);
        text += 3;
    }
    return end;
}

HSEP_API int hsep_uri_folder(const char *uri, int windows, char *folder)
{
    char *end = folder;
    if (resource_begins(uri, "file:")) {
        uri += strlen("file:");
        if (uri[0] == '/' && uri[1] == '/') {
            const char *host = uri + 2;
            const size_t length = strcspn(host, "/");
            const int here = length == 0 || (length == strlen("localhost") && resource_begins(host, "localhost"));
            if (!here && !windows) {
                return 0;
            }
            uri = here ? host + length : uri;
        }
        if (windows && uri[0] == '/' && uri[1] != '\0' && (uri[2] == ':' || uri[2] == '|')) {
            *end++ = uri[1];
            *end++ = ':';
            uri += 3;
        }
        end = resource_decode(uri, end);
    } else if (uri[0] == '/' || strstr(uri, "://") == NULL) {
        const size_t length = strlen(uri);
        memcpy(end, uri, length);
        end += length;
    } else {
        return 0;
    }
    if (end == NULL || end == folder) {
        return 0;
    }
    if (end[-1] != '/' && !(windows && end[-1] == '\\')) {
        *end++ = '/';
    }
    *end = '\0';
    return 1;
}

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
