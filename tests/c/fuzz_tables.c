/* Mutated tables of an FMU whose library serves all FMUs of its kind, to be compiled with the sanitisers on.
 *
 * Arguments: the FMU's own table, a folder for the mutated ones, their number, a seed. A finding is a crash, a
 * sanitiser's report, a refusal without a message, a block of memory that was not given back, or a table that was
 * changed without its checksum and taken. */
#include "all.c"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define TABLE_MAX 65536             /* bytes of a mutated table */
#define BLOCK_MAX ((size_t)1 << 22) /* bytes that the importer has for a block */
#define GUID_PLACE 48
#define STEP_SIZE 1e-3 /* s */

typedef struct {
    unsigned char bytes[TABLE_MAX];
    size_t size;
} file_content;

static uint64_t random_state;
static long n_blocks, n_errors;
static uint64_t n_refused, n_run;

static uint64_t draw(void) /* SplitMix64 */
{
    uint64_t z = (random_state += UINT64_C(0x9E3779B97F4A7C15));
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

static size_t below(size_t n) { return (size_t)(draw() % n); }

static void finding(uint64_t i, const char *what)
{
    printf("table %" PRIu64 ": %s\n", i, what);
    exit(1);
}

static void *allocate(size_t count, size_t size)
{
    if (size > 0 && count > BLOCK_MAX / size) {
        return NULL;
    }
    n_blocks++;
    return calloc(count > 0 ? count : 1, size > 0 ? size : 1);
}

static void give_back(void *block)
{
    n_blocks -= block != NULL;
    free(block);
}

static void log_message(
    fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...)
{
    char whole[4096];
    va_list arguments;
    (void)environment, (void)name, (void)category;
    va_start(arguments, text);
    vsnprintf(whole, sizeof whole, text, arguments);
    va_end(arguments);
    n_errors += status == fmi2Error && strlen(whole) > 0;
}

static void put(file_content *table, size_t word, const void *number) { memcpy(table->bytes + 8 * word, number, 8); }

static uint64_t word_of(const file_content *table, size_t word)
{
    uint64_t number;
    memcpy(&number, table->bytes + 8 * word, 8);
    return number;
}

static void mutate_once(file_content *table)
{
    static const double numbers[] = {0.0,   -0.0,   1.0, -1.0, 2.0, 0.5,      1e-300,
                                     1e300, -1e300, 1e5, 1e9,  NAN, HUGE_VAL, -HUGE_VAL};
    static const uint64_t counts[] = {0, 1, 2, 7, UINT64_C(1) << 31, UINT64_C(1) << 61, UINT64_MAX};
    static const size_t more[] = {8, 32, 32, 64, 3200};
    const size_t what = below(10);
    if (what < 3) {
        table->bytes[below(table->size)] ^= (unsigned char)(1U << below(8));
    } else if (what < 6) {
        put(table, below(table->size / 8), &numbers[below(sizeof numbers / sizeof *numbers)]);
    } else if (what < 8) {
        const size_t i = below(sizeof counts / sizeof *counts + 1);
        const uint64_t number = i < sizeof counts / sizeof *counts ? counts[i] : draw();
        put(table, below(6), &number);
    } else if (what < 9) {
        const size_t left = below(table->size);
        memset(table->bytes + left, 0, table->size - left);
        table->size = left > 48 ? left : 48;
    } else {
        const size_t end = table->size + more[below(sizeof more / sizeof *more)];
        while (table->size < end && table->size < TABLE_MAX) {
            table->bytes[table->size++] = (unsigned char)draw();
        }
    }
}

/* Let size and checksum fit, and mostly the number of modes. */
static void repair(file_content *table, const file_content *own)
{
    if (table->size < 24) {
        return;
    }
    const uint64_t size = table->size;
    put(table, 1, &size);
    if (table->size > 40 && below(10) < 7) {
        const uint64_t modes = word_of(own, 3) + table->size / 32 - own->size / 32;
        put(table, 3, &modes);
    }
    const uint64_t sum = hsep_crc(0, table->bytes, table->size - 8);
    memcpy(table->bytes + table->size - 8, &sum, 8);
}

/* Initialise, step and read; a refusal ends it. */
static void simulate(fmi2Component component)
{
    if (fmi2EnterInitializationMode(component) != fmi2OK || fmi2ExitInitializationMode(component) != fmi2OK) {
        return;
    }
    n_run++;
    const size_t n_steps = below(16) > 0 ? 12 : 220;
    for (size_t k = 0; k < n_steps; k++) {
        for (unsigned i = 0; i < HSEP_N_SCALARS; i++) {
            const double position = 1e-2 * ((double)(draw() >> 11) * 0x1p-52 - 1.0);
            if (hsep_variables[i].causality == HSEP_INPUT) {
                (void)fmi2SetReal(component, &i, 1, &position);
            }
        }
        if (fmi2DoStep(component, (double)k * STEP_SIZE, STEP_SIZE, fmi2True) != fmi2OK) {
            return;
        }
    }
    for (unsigned i = 0; i < HSEP_N_SCALARS; i++) {
        double real;
        int whole;
        switch (hsep_variables[i].kind) {
        case HSEP_REAL:
            (void)fmi2GetReal(component, &i, 1, &real);
            break;
        case HSEP_BOOLEAN:
            (void)fmi2GetBoolean(component, &i, 1, &whole);
            break;
        default:
            (void)fmi2GetInteger(component, &i, 1, &whole);
            break;
        }
    }
}

static void write_table(const file_content *table, const char *folder)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/variables.bin", folder);
    (void)remove(path); /* some file systems write a file to the disk that is emptied, which takes milliseconds */
    FILE *file = fopen(path, "wb");
    if (file == NULL || fwrite(table->bytes, 1, table->size, file) != table->size || fclose(file) != 0) {
        finding(0, "the table cannot be written");
    }
}

int main(int n_arguments, char *arguments[])
{
    static file_content own, table;
    char location[4096], guid[HSEP_GUID_SIZE];
    const fmi2CallbackFunctions callbacks = {log_message, allocate, give_back, NULL, NULL};
    FILE *file = n_arguments == 5 ? fopen(arguments[1], "rb") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: %s TABLE FOLDER NUMBER SEED\n", arguments[0]);
        return 2;
    }
    own.size = fread(own.bytes, 1, sizeof own.bytes, file);
    fclose(file);
    memcpy(guid, own.bytes + GUID_PLACE, sizeof guid);
    snprintf(location, sizeof location, "file://%s", arguments[2]);
    const uint64_t n = strtoull(arguments[3], NULL, 10);
    for (uint64_t i = 0; i < n; i++) {
        random_state = strtoull(arguments[4], NULL, 10) * UINT64_C(1000003) + i; /* each can be repeated alone */
        table = own;
        static const size_t mutations[] = {1, 1, 1, 2, 5};
        for (size_t left = mutations[below(5)]; left > 0; left--) {
            mutate_once(&table);
        }
        const int whole = below(10) < 7;
        if (whole) {
            repair(&table, &own);
        }
        write_table(&table, arguments[2]);
        n_errors = 0;
        fmi2Component component =
            fmi2Instantiate("one", fmi2CoSimulation, guid, location, &callbacks, fmi2False, fmi2False);
        if (component == NULL) {
            n_refused++;
            if (n_errors == 0) {
                finding(i, "refused without a message");
            }
        } else {
            if (!whole && (table.size != own.size || memcmp(table.bytes, own.bytes, own.size) != 0)) {
                finding(i, "a damaged table was taken");
            }
            simulate(component);
            fmi2FreeInstance(component);
        }
        if (n_blocks != 0) {
            finding(i, "memory was not given back");
        }
    }
    printf("no finding: %" PRIu64 " tables, %" PRIu64 " refused, %" PRIu64 " simulated\n", n, n_refused, n_run);
    return 0;
}
