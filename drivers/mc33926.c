#include "mc33926.h"

#include <errno.h>
#include <math.h>
#include <string.h>

static const double kFaultBits = 20.0; /* one false alarm in a million runs of low samples */

bool mc33926_fault_update(mc33926_fault_filter_t* filter, double duty, bool sf_low) {
  const double driven = fabs(duty);
  if (!(driven > 0.0)) return filter->evidence_bits >= kFaultBits; /* coasting: SF means nothing */
  if (!sf_low) {
    filter->evidence_bits = 0.0;
    return false;
  }
  const bool stood = filter->evidence_bits >= kFaultBits;
  const double bits = driven < 1.0 ? -log2(1.0 - driven) : kFaultBits;
  filter->evidence_bits = fmin(filter->evidence_bits + bits, kFaultBits);
  if (filter->evidence_bits < kFaultBits) return false;
  if (!stood) ++filter->faults;
  return true;
}

int mc33926_open(mc33926_t* motor, const hbridge_config_t* config, const gpio_pin_t* status_flag,
                 const char** culprit) {
  memset(motor, 0, sizeof *motor);
  if (culprit != NULL) *culprit = "pwm";
  if (config->period_ns < 1000000000u / MC33926_MAX_PWM_HZ) return -EINVAL;
  int status = hbridge_open(&motor->bridge, config, culprit);
  if (status < 0 || status_flag == NULL) return status;
  status = gpio_open_input(&motor->status_flag, status_flag);
  if (status < 0) {
    if (culprit != NULL) *culprit = "status_flag";
    hbridge_close(&motor->bridge);
  }
  return status;
}

int mc33926_write(mc33926_t* motor, double duty) { return hbridge_write(&motor->bridge, duty); }

int mc33926_coast(mc33926_t* motor) { return hbridge_off(&motor->bridge); }

int mc33926_sample_fault(mc33926_t* motor, bool* fault) {
  *fault = false;
  if (!gpio_is_open(&motor->status_flag)) return 0;
  const int flag = gpio_get(&motor->status_flag);
  if (flag < 0) return flag;
  *fault = mc33926_fault_update(&motor->fault, motor->bridge.duty, flag == 1);
  return 0;
}

void mc33926_close(mc33926_t* motor) {
  hbridge_close(&motor->bridge);
  gpio_close(&motor->status_flag);
}
