/* The HAL component without LinuxCNC, one axis at a time: pins are plain memory, and Python steps them. COMPONENT is
 * the file that hybridsep hal has written; the headers that it includes are empty here. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define RTAPI_MSG_ERR 1
#define RTAPI_MP_ARRAY_STRING(variable, count, description)
#define MODULE_AUTHOR(text)
#define MODULE_DESCRIPTION(text)
#define MODULE_LICENSE(text)
#define HAL_NAME_LEN 47
#define rtapi_snprintf snprintf

typedef volatile double hal_float_t;
typedef volatile bool hal_bit_t;
typedef volatile int32_t hal_s32_t;
typedef volatile uint32_t hal_u32_t;
enum { HAL_IN, HAL_OUT, HAL_RO, HAL_RW };

static int n_messages, longest_name;
static char last_message[1024];

static void rtapi_print_msg(int level, const char *format, ...)
{
    va_list values;
    (void)level;
    va_start(values, format);
    vsnprintf(last_message, sizeof last_message, format, values);
    va_end(values);
    n_messages++;
}

static int named(const char *format, va_list values)
{
    const int length = vsnprintf(NULL, 0, format, values);
    longest_name = length > longest_name ? length : longest_name;
    return length > HAL_NAME_LEN ? -1 : 0;
}

#define STUB_NEW(function, type, value, action) \
    static int function(int way, type value, int id, const char *format, ...) \
    { \
        va_list values; \
        va_start(values, format); \
        const int refused = named(format, values); \
        va_end(values); \
        (void)way, (void)id, action; \
        return refused; \
    }
#define STUB_PIN(kind) STUB_NEW(hal_pin_##kind##_newf, hal_##kind##_t, **pin, *pin = calloc(1, sizeof **pin))
#define STUB_PARAMETER(kind) STUB_NEW(hal_param_##kind##_newf, hal_##kind##_t, *value, (void)value)
STUB_PIN(float)
STUB_PIN(bit)
STUB_PIN(s32)
STUB_PARAMETER(float)
STUB_PARAMETER(u32)

static int hal_init(const char *name) { return name != NULL; }
static int hal_ready(int id) { return id - id; }
static int hal_exit(int id) { return id - id; }
static void *hal_malloc(long size) { return calloc(1, (size_t)size); }
static int hal_export_funct(const char *name, void (*step)(void *, long), void *data, int fp, int reentrant, int id)
{
    (void)name, (void)step, (void)data, (void)fp, (void)reentrant, (void)id;
    return 0;
}

#include COMPONENT

int stub_load(char *folder)
{
    rtapi_app_exit();
    n_messages = longest_name = 0;
    axes[0] = folder;
    return rtapi_app_main();
}

void stub_parameters(double scale, int model)
{
    axis_all[0].pins->scale = scale;
    axis_all[0].pins->model = (hal_u32_t)model;
}

/* Let the model refuse the next sample. */
void stub_break(void) { axis_all[0].k += 1000; }

double stub_scale(void) { return axis_all[0].pins->scale; }
int stub_look_ahead(void) { return (int)axis_all[0].pins->look_ahead; }
int stub_messages(void) { return n_messages; }
int stub_longest_name(void) { return longest_name; }
const char *stub_message(void) { return last_message; }

/* A period, ns, with the inputs cmd, fb, active, enable, reset; to outputs out, delayed, fb-joint, predicted, error,
 * std and state. */
void stub_step(long period, const double inputs[5], double outputs[7])
{
    axis_pins *pins = axis_all[0].pins;
    *pins->cmd = inputs[0];
    *pins->fb = inputs[1];
    *pins->active = inputs[2] != 0.0;
    *pins->enable = inputs[3] != 0.0;
    *pins->reset = inputs[4] != 0.0;
    axis_step(&axis_all[0], period);
    const double shown[7] = {*pins->out,   *pins->delayed, *pins->fb_joint, *pins->predicted,
                             *pins->error, *pins->std_dev, *pins->state};
    memcpy(outputs, shown, sizeof shown);
}
