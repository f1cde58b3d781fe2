#include "hsep_weights.h"

#include "hsep_check.h"
#include "hsep_layout.h"
#include "hsep_resource.h"

#include <string.h>

#define WEIGHTS_FILE "weights.bin"
#define WEIGHTS_MAGIC "HSEPWGT2"
#define WEIGHTS_CHUNK 512 /* bytes that are summed up at once, a multiple of 8 */

/* What stands before the modes. */
typedef struct {
    char magic[8];
    uint64_t p, q, input_hold, dead_time, n_modes, n_samples;
    double lambda, T_s, v_friction;
} weights_head;

HSEP_ASSERT_WORDS(weights_head, 10);

/* CRC-32 as in zlib, 4 bits at a time, of bytes behind those that gave crc. */
static uint32_t weights_crc(uint32_t crc, const unsigned char bytes[], size_t size)
{
    static const uint32_t table[16] = {0x00000000U, 0x1DB71064U, 0x3B6E20C8U, 0x26D930ACU, 0x76DC4190U, 0x6B6B51F4U,
                                       0x4DB26158U, 0x5005713CU, 0xEDB88320U, 0xF00F9344U, 0xD6D6A3E8U, 0xCB61B38CU,
                                       0x9B64C2B0U, 0x86D3D2D4U, 0xA00AE278U, 0xBDBDF21CU};
    crc = ~crc;
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        crc = (crc >> 4) ^ table[crc & 15U];
        crc = (crc >> 4) ^ table[crc & 15U];
    }
    return ~crc;
}

/* Whether the file is whole: its last 8 bytes are the checksum of the others. size: of all of it, bytes. It is put back
 * to its beginning. */
static int weights_whole(FILE *file, double *size)
{
    unsigned char bytes[WEIGHTS_CHUNK + sizeof(uint64_t)];
    uint32_t crc = 0;
    uint64_t sum = 0;
    size_t held = 0; /* of the bytes: the last 8 so far may be the checksum */
    *size = 0.0;
    for (;;) {
        const size_t read = fread(bytes + held, 1, sizeof bytes - held, file);
        *size += (double)read;
        held += read;
        if (held < sizeof bytes) {
            break;
        }
        crc = weights_crc(crc, bytes, WEIGHTS_CHUNK);
        held -= WEIGHTS_CHUNK;
        memcpy(bytes, bytes + WEIGHTS_CHUNK, held);
    }
    if (held < sizeof sum || fseek(file, 0, SEEK_SET) != 0) {
        return 0;
    }
    memcpy(&sum, bytes + held - sizeof sum, sizeof sum);
    return sum == weights_crc(crc, bytes, held - sizeof sum);
}

static void weights_compare(const char *name, double learned, double got, hsep_kind kind, char message[])
{
    char then[HSEP_NUMBER_SIZE], now[HSEP_NUMBER_SIZE];
    if (learned != got) {
        hsep_message_add(
            message, "%s must be %s, with which " WEIGHTS_FILE " was learned, got %s", name,
            hsep_number(then, learned, kind), hsep_number(now, got, kind));
    }
}

/* Read the modes that the file has and compare those that there are on both sides. */
static int weights_compare_modes(
    FILE *file, uint64_t n_learned, const hsep_predictor_parameters *settings, char message[])
{
    static const char *const names[4] = {"f_n", "zeta", "alpha", "beta"};
    for (uint64_t i = 0; i < n_learned && i < settings->n_modes; i++) {
        const hsep_mode *mode = &settings->modes[i];
        const double got[4] = {mode->f_n, mode->zeta, mode->alpha, mode->beta};
        double learned[4];
        if (fread(learned, sizeof *learned, 4, file) != 4) {
            return 0;
        }
        for (int j = 0; j < 4; j++) {
            char name[HSEP_NUMBER_SIZE];
            snprintf(name, sizeof name, "mode[%.0f].%s", (double)i + 1.0, names[j]);
            weights_compare(name, learned[j], got[j], HSEP_REAL, message);
        }
    }
    weights_compare("the number of modes", (double)n_learned, (double)settings->n_modes, HSEP_INTEGER, message);
    return 1;
}

/* Read the file: 0 if it is damaged; with a message, if it was learned with other settings. */
static int weights_take(
    FILE *file, const hsep_predictor_parameters *settings, hsep_regression *regression, char message[])
{
    weights_head head;
    double size = 0.0;
    if (!weights_whole(file, &size) || fread(&head, sizeof head, 1, file) != 1 ||
        memcmp(head.magic, WEIGHTS_MAGIC, sizeof head.magic) != 0) {
        return 0;
    }
    weights_compare("p", (double)head.p, (double)settings->p, HSEP_INTEGER, message);
    weights_compare("q", (double)head.q, (double)settings->q, HSEP_INTEGER, message);
    weights_compare("lambda", head.lambda, settings->lambda, HSEP_REAL, message);
    weights_compare("T_s", head.T_s, settings->T_s, HSEP_REAL, message);
    weights_compare("input_hold", (double)head.input_hold, (double)settings->hold, HSEP_INTEGER, message);
    weights_compare("dead_time", (double)head.dead_time, (double)settings->dead_time, HSEP_INTEGER, message);
    weights_compare("v_friction", head.v_friction, settings->v_friction, HSEP_REAL, message);
    if (!weights_compare_modes(file, head.n_modes, settings, message) || message[0] != '\0') {
        return 0;
    }
    const double n = (double)regression->n, doubles = 4.0 * (double)head.n_modes + 0.5 * (n + 1.0) * (n + 2.0) + 1.0;
    if (size != (double)sizeof head + doubles * (double)sizeof(double)) {
        return 0;
    }
    for (uint64_t i = 0; i <= regression->n; i++) { /* row after row through the regression's own row */
        const size_t left = (size_t)(regression->n + 1 - i);
        if (fread(hsep_regression_row(regression), sizeof(double), left, file) != left ||
            !hsep_regression_load(regression, i)) {
            return 0;
        }
    }
    regression->n_samples = head.n_samples;
    return 1;
}

HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, const hsep_predictor_parameters *settings, hsep_regression *regression, char message[])
{
    FILE *file = hsep_resource_open(context, WEIGHTS_FILE);
    if (file == NULL) {
        return HSEP_OK;
    }
    const int taken = weights_take(file, settings, regression, message);
    fclose(file);
    if (!taken && message[0] == '\0') {
        hsep_message_add(message, WEIGHTS_FILE " must be a factor of learned rows; it is damaged or truncated");
    }
    return taken ? HSEP_OK : HSEP_REFUSED;
}
