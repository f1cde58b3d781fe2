// The same in C++11.
#include "main.c"
