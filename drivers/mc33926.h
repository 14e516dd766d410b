/* mc33926.h: one NXP MC33926 bridge, wired drive/coast: direction on IN1/IN2, PWM on D2, D1 low, EN shared
 * (bbb.c). D2 low: all transistors off, the motor coasts. In: signed duty. Out: status flag SF as a fault
 * count. Source: MC33926 data sheet, truth table and status flag. Real-time safe. */
#ifndef EQUIPOISE_DRIVERS_MC33926_H
#define EQUIPOISE_DRIVERS_MC33926_H

#include "hbridge.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { MC33926_MAX_PWM_HZ = 20000 };

/* SF is low on a fault, but also in every coast phase, and each PWM edge clears a latched fault so that the
 * bridge tries again: one low sample says little. Each adds the information that chance would not explain it,
 * -log2(1 - |duty|) bits; one high sample clears the sum; at 20 bits it is a fault. */
typedef struct mc33926_fault_filter {
  double evidence_bits;
  uint32_t faults; /* events since open */
} mc33926_fault_filter_t;

/* Pure. Returns true while the fault stands. */
bool mc33926_fault_update(mc33926_fault_filter_t* filter, double duty, bool sf_low);

typedef struct mc33926 {
  hbridge_t bridge;
  gpio_line_t status_flag; /* optional */
  mc33926_fault_filter_t fault;
} mc33926_t;

/* `status_flag` may be NULL; its pin must be active low. -EINVAL: PWM above 20 kHz. */
int mc33926_open(mc33926_t* motor, const hbridge_config_t* config, const gpio_pin_t* status_flag,
                 const char** culprit);
int mc33926_write(mc33926_t* motor, double duty);
int mc33926_coast(mc33926_t* motor);
int mc33926_sample_fault(mc33926_t* motor,
                         bool* fault); /* between two writes; not while coasting or disabled */
void mc33926_close(mc33926_t* motor);  /* coasting */

#ifdef __cplusplus
}
#endif

#endif
