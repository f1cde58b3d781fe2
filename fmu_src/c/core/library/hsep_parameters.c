/* Parameters of the library: their ranges, and what predictor and compensator derive from them. */
#include "hsep_compensator.h"

static const hsep_real parameters_warm_up_tolerance = 1e-6; /* samples: rounding of times cannot tell */
static const hsep_real parameters_warm_up = 0.3;            /* s, where it is automatic, without averaging */

HSEP_API void hsep_defaults(hsep_parameters *parameters)
{
    memset(parameters, 0, sizeof *parameters);
#define USUAL(of, type, name, usual, least, most, nonzero, automatic, learned) parameters->of.name = (type)usual;
    HSEP_PREDICTOR_SETTINGS(USUAL)
    HSEP_AVERAGING_SETTINGS(USUAL)
    HSEP_COMPENSATOR_SETTINGS(USUAL)
#undef USUAL
}

/* Refuse a parameter whose value is out of its range, in which nonzero is the least magnitude but 0, unless another one
 * is refused already; NaN is in no range. */
static void parameters_check(
    const char **refused, const char *name, hsep_real value, hsep_real least, hsep_real most, hsep_real nonzero,
    hsep_real automatic)
{
    const int tiny = hsep_fabs(value) > 0.0 && hsep_fabs(value) < nonzero;
    const int allowed = (value >= least && value <= most && !tiny) || value == automatic;
    if (*refused == NULL && !allowed) {
        *refused = name;
    }
}

#define CHECK(of, type, name, usual, least, most, nonzero, automatic, learned) \
    parameters_check(&refused, #name, (hsep_real)parameters->of.name, least, most, nonzero, automatic);
#define CHECK_MODE(of, type, name, usual, least, most, nonzero, automatic, learned) \
    parameters_check(&refused, #name, parameters->modes[i].name, least, most, nonzero, automatic);

HSEP_API const char *hsep_predictor_refused(const hsep_parameters *parameters)
{
    const hsep_predictor_settings *settings = &parameters->predictor;
    const char *refused = NULL;
    HSEP_PREDICTOR_SETTINGS(CHECK)
    HSEP_AVERAGING_SETTINGS(CHECK)
    if (refused == NULL && (parameters->n_modes < 1 || parameters->modes == NULL)) {
        refused = "modes";
    }
    for (hsep_int i = 0; refused == NULL && i < parameters->n_modes; i++) {
        HSEP_MODE_SETTINGS(CHECK_MODE)
    }
    if (refused != NULL) {
        return refused;
    }
    return settings->p > settings->Np ? "p" : settings->q >= settings->Np ? "q" : NULL;
}

HSEP_API const char *hsep_compensator_refused(const hsep_parameters *parameters)
{
    const hsep_compensator_settings *settings = &parameters->compensator;
    const hsep_predictor_settings *predictor = &parameters->predictor;
    const char *refused = hsep_predictor_refused(parameters);
    HSEP_COMPENSATOR_SETTINGS(CHECK)
    if (refused != NULL) {
        return refused;
    }
    if (predictor->Np % settings->spacing != 0) {
        return "spacing";
    }
    if (settings->preview < predictor->Np + 4 * settings->spacing + HSEP_SPLINES_END) {
        return "preview";
    }
    return predictor->measurement_delay > 0 && !parameters->averaging.averaging ? "measurement_delay" : NULL;
}

#undef CHECK_MODE
#undef CHECK

/* Warm-up, s. */
static hsep_real parameters_t_init(const hsep_parameters *parameters)
{
    const hsep_real automatic = parameters->averaging.averaging ? 0.0 : parameters_warm_up;
    return parameters->predictor.t_init < 0.0 ? automatic : parameters->predictor.t_init;
}

/* How many samples, from the first one at 0, are before t; whole, >= 0. */
static hsep_real parameters_samples(hsep_real t, hsep_real T_s)
{
    return hsep_fmax(0.0, hsep_ceil(t / T_s - parameters_warm_up_tolerance));
}

HSEP_API hsep_predictor_parameters hsep_predictor_derive(const hsep_parameters *parameters)
{
    const hsep_predictor_settings *settings = &parameters->predictor;
    return (hsep_predictor_parameters){
        .settings = *settings,
        .averaging = parameters->averaging,
        .compensator = parameters->compensator,
        .preview = settings->Np,
        .horizon = settings->Np,
        /* The warm-up counts from the end of the first fill. */
        .n_init = (hsep_real)settings->Np + parameters_samples(parameters_t_init(parameters), settings->T_s),
        .n_modes = parameters->n_modes,
        .modes = parameters->modes};
}

HSEP_API hsep_predictor_parameters hsep_compensator_derive(const hsep_parameters *parameters)
{
    const hsep_compensator_settings *settings = &parameters->compensator;
    const hsep_int Np = parameters->predictor.Np, preview = settings->preview;
    const hsep_real T_s = parameters->predictor.T_s, t_init = parameters_t_init(parameters);
    hsep_predictor_parameters derived = hsep_predictor_derive(parameters);
    /* After the window, and what the next one leaves as it is, a stop has to fit into the preview. */
    const int fits = preview >= Np + Np / 2 + 5 * settings->spacing + HSEP_SPLINES_END;
    derived.preview = preview;
    derived.horizon = fits && settings->horizon > preview ? settings->horizon : preview;
    derived.n_lost = (hsep_int)parameters_samples(settings->measurement_timeout, T_s);
    /* The warm-up counts from the end of the first fill; without one, what is known plans the first window. */
    derived.n_init = parameters_samples(t_init > 0.0 ? t_init + (hsep_real)preview * T_s : 0.0, T_s);
    derived.compensates = 1;
    return derived;
}
