#include "hsep_weights.h"

#include "hsep_check.h"
#include "hsep_resource.h"
#include "hsep_schedule.h"

#define WEIGHTS_FILE "weights.bin"

/* Bytes of the triangle of a factor with n features. */
static double weights_bytes(double n) { return 0.5 * (n + 1.0) * (n + 2.0) * (double)sizeof(double); }

HSEP_API hsep_status hsep_weights_load(
    const hsep_context *context, uint64_t p, uint64_t q, hsep_regression *regression, char message[])
{
    FILE *file = hsep_resource_open(context, WEIGHTS_FILE);
    if (file == NULL) {
        return HSEP_OK;
    }
    const double n = (double)regression->n, plain = 2.0 + (double)q + (double)p;
    const double other = n > plain ? plain : plain + HSEP_SCHEDULED; /* features if v_s were the other way */
    uint64_t head[3] = {0, 0, 0}; /* p, q, learned samples */
    const double bytes = hsep_resource_head(file, "HSEPWGT1", head, 3);
    int taken = bytes == weights_bytes(n);
    if (bytes >= 0.0 && (head[0] != p || head[1] != q)) {
        hsep_message_add(
            message,
            WEIGHTS_FILE " was learned with p = %.0f, q = %.0f, got p = %.0f, q = %.0f; "
                         "set p and q as they were learned",
            (double)head[0], (double)head[1], (double)p, (double)q);
        taken = 0;
    } else if (bytes == weights_bytes(other)) {
        hsep_message_add(
            message, other > n ? WEIGHTS_FILE " was learned with v_s > 0, got v_s = 0; set v_s as it was learned"
                               : WEIGHTS_FILE " was learned with v_s = 0, got v_s > 0; set v_s as it was learned");
    }
    for (uint64_t i = 0; taken && i <= regression->n; i++) { /* row after row through the regression's own row */
        const size_t left = (size_t)(regression->n + 1 - i);
        taken = fread(hsep_regression_row(regression), sizeof(double), left, file) == left &&
                hsep_regression_load(regression, i);
    }
    fclose(file);
    if (!taken) {
        if (message[0] == '\0') {
            hsep_message_add(message, WEIGHTS_FILE " must be a factor of learned rows; it is damaged or truncated");
        }
        return HSEP_REFUSED;
    }
    regression->n_samples = head[2];
    return HSEP_OK;
}
