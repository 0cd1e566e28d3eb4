/* The functions of one memory, as table.c lists them; what they do is in device.h */
#pragma once
#include "kernel.h"

#ifdef __cplusplus
extern "C" {
#endif

/* memory.c */
int         NAME(allocate)(const DeviceQueue *, size_t, void **);
int         NAME(release)(const DeviceQueue *, void *);
int         NAME(upload)(const DeviceQueue *, size_t, const void *, void *);
int         NAME(download)(const DeviceQueue *, size_t, const void *, void *);
int         NAME(zero)(const DeviceQueue *, size_t, void *);
int         NAME(wait)(const DeviceQueue *);
const char *NAME(explain)(int);
/* slots.c */
int NAME(set_fixed)(const DeviceQueue *, const DeviceCells *, const unsigned char[], int[]);
int NAME(copy_slots)(const DeviceQueue *, int, const int[], const double[], double[]);
/* coefficients.c */
int NAME(set_coefficients)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], const double[],
                           double[]);
/* product.c */
int NAME(multiply)(const DeviceQueue *, const DeviceCells *, const DeviceForm *, const double[], int, const double[],
                   double[]);

#ifdef __cplusplus
}
#endif
