#include "hsep_table.h"

#include "hsep_text.h"

/* The numbers of the modes are read in place. */
HSEP_ASSERT(numbers_of_a_mode, sizeof(hsep_mode) == HSEP_MODE_NUMBERS * sizeof(double));

HSEP_API size_t hsep_table_n_starts(const hsep_context *context)
{
    return context->n_scalars + HSEP_MODE_NUMBERS * context->n_modes + context->n_last;
}

HSEP_API const hsep_variable *hsep_table_row(const hsep_context *context, size_t place)
{
    const size_t before = hsep_table_n_starts(context), last = before - context->n_last;
    const size_t after = context->n_scalars + (context->n_modes > 0 ? HSEP_MODE_NUMBERS : 0);
    size_t row = place;
    if (place >= before) {
        row = after + context->n_last + (place - before) / context->window;
    } else if (place >= last) {
        row = after + place - last;
    } else if (place >= context->n_scalars) {
        row = context->n_scalars + (place - context->n_scalars) % HSEP_MODE_NUMBERS;
    }
    return &context->variables[row];
}

HSEP_API const char *hsep_table_name(const hsep_context *context, size_t place, char text[HSEP_NAME_SIZE])
{
    const size_t before = hsep_table_n_starts(context);
    const char *name = hsep_table_row(context, place)->name;
    if (place >= before) {
        const size_t sample = (place - before) % context->window + 1;
        hsep_text(text, HSEP_NAME_SIZE, "%.40s[%lu]", name, (unsigned long)sample);
        return text;
    }
    if (place >= context->n_scalars && place < before - context->n_last) {
        const size_t mode = (place - context->n_scalars) / HSEP_MODE_NUMBERS + 1;
        hsep_text(text, HSEP_NAME_SIZE, "mode[%lu].%.30s", (unsigned long)mode, name);
        return text;
    }
    return name;
}

HSEP_API size_t hsep_table_place(const hsep_context *context, const char *name)
{
    char text[HSEP_NAME_SIZE];
    size_t place = 0;
    while (place < context->n_variables && strcmp(hsep_table_name(context, place, text), name) != 0) {
        place++;
    }
    return place;
}

HSEP_API const hsep_mode *hsep_table_modes(const hsep_context *context, const double values[])
{
    return (const hsep_mode *)(const void *)&values[context->n_scalars];
}
