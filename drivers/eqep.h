/* eqep.h: one quadrature decoder (AM335x eQEP) through either kernel interface: the counter subsystem, or
 * the 4.x `position` attribute. In: the device's address, "48300180". Out: counts, unwrapped to 64 bit from 0
 * at open. read() is real-time safe: one system call. An error is a status, never a count. */
#ifndef EQUIPOISE_DRIVERS_EQEP_H
#define EQUIPOISE_DRIVERS_EQEP_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct eqep {
  int fd;
  uint64_t modulus; /* the hardware counts modulo this: ceiling + 1, or 2^32 */
  uint64_t last;
  int64_t counts;
} eqep_t;

/* -ENODEV: no such device, so no driver or not in the device tree; else the errno of the attribute that
 * failed. */
int eqep_open(eqep_t* encoder, const char* device);
int eqep_read(eqep_t* encoder, int64_t* counts); /* -ERANGE: beyond the ceiling */
void eqep_close(eqep_t* encoder);                /* also of zeroed memory: closes nothing */

/* Signed way from `last` to `now`, both modulo `modulus`, the shorter one. Pure. */
int64_t eqep_difference(uint64_t last, uint64_t now, uint64_t modulus);

#ifdef __cplusplus
}
#endif

#endif
