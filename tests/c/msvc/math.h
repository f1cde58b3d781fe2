/* What a source FMU needs of math.h, as Microsoft's compiler has it: stands in for its headers, which are not free. */
#ifndef MATH_H
#define MATH_H
#define HUGE_VAL ((double)(float)(1e300 * 1e300))
#define INFINITY ((float)(1e300 * 1e300))
#define NAN (-(float)(((float)(1e300 * 1e300)) * 0.0F))
double ceil(double);
double copysign(double, double);
double cos(double);
double exp(double);
double fabs(double);
double fmax(double, double);
double fmin(double, double);
double fmod(double, double);
double floor(double);
double frexp(double, int *);
double ldexp(double, int);
double log(double);
double log10(double);
double nextafter(double, double);
double pow(double, double);
double sin(double);
double sqrt(double);
double tanh(double);
short _dclass(double);
int _fdsign(double);
#define isfinite(x) (_dclass(x) <= 0)
#define signbit(x) (_fdsign(x) != 0)
#define isnan(x) (_dclass(x) == 2)
#endif
