#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bbb_error.h"
#include "bbb_internal.h"
#include "monotonic.h"

static gpio_pin_t pin_of(const bbb_pin_t* pin) {
  const gpio_pin_t out = {.chip = pin->chip, .offset = pin->line, .active_low = pin->active_low};
  return out;
}

static int fail_pin(bbb_error_t* error, int code, const char* what, const bbb_pin_t* pin) {
  char device[BBB_NAME_MAX + 32];
  snprintf(device, sizeof device, "gpio chip %s line %u", pin->chip, pin->line);
  return bbb_fail(error, code, what, device);
}

static int open_enable(bbb_t* bbb, const bbb_config_t* config, bbb_error_t* error) {
  if (!config->enable.used || config->enable_held_elsewhere) return 0;
  const gpio_pin_t pin = pin_of(&config->enable);
  const int status = gpio_open_output(&bbb->enable, &pin, false);
  return status < 0 ? fail_pin(error, status, "bridge enable", &config->enable) : 0;
}

static int fail_motor(bbb_error_t* error, int code, uint32_t index, const char* part,
                      const bbb_motor_t* motor) {
  char what[48];
  snprintf(what, sizeof what, "motor %u %s", index + 1, part);
  if (strcmp(part, "in1") == 0) return fail_pin(error, code, what, &motor->in1);
  if (strcmp(part, "in2") == 0) return fail_pin(error, code, what, &motor->in2);
  if (strcmp(part, "status_flag") == 0) return fail_pin(error, code, what, &motor->fault);
  char device[BBB_NAME_MAX + 32];
  snprintf(device, sizeof device, "%s channel %u", motor->pwm, motor->pwm_channel);
  return bbb_fail(error, code, what, device);
}

static int open_motor(bbb_t* bbb, const bbb_config_t* config, uint32_t index, bbb_error_t* error) {
  const bbb_motor_t* motor = &config->motor[index];
  bbb_wheel_t* wheel = &bbb->wheel[index];
  const hbridge_config_t bridge = {.in1 = pin_of(&motor->in1),
                                   .in2 = pin_of(&motor->in2),
                                   .pwm = motor->pwm,
                                   .pwm_channel = motor->pwm_channel,
                                   .period_ns = 1000000000u / config->pwm_hz,
                                   .reversed = motor->motor_reversed};
  const gpio_pin_t fault = pin_of(&motor->fault);
  const char* part = NULL;
  wheel->type = motor->bridge;
  int status = motor->bridge == BBB_MC33926
                   ? mc33926_open(&wheel->driver.mc33926, &bridge, motor->fault.used ? &fault : NULL, &part)
                   : tb6612_open(&wheel->driver.tb6612, &bridge, &part);
  if (status < 0) return fail_motor(error, status, index, part, motor);
  wheel->open = true;
  return 0;
}

static int open_encoder(bbb_t* bbb, const bbb_config_t* config, uint32_t index, bbb_error_t* error) {
  bbb_wheel_t* wheel = &bbb->wheel[index];
  char what[32];
  snprintf(what, sizeof what, "encoder %u eQEP", index + 1);
  wheel->encoder_reversed = config->motor[index].encoder_reversed;
  const int status = eqep_open(&wheel->encoder, config->motor[index].encoder);
  return status < 0 ? bbb_fail(error, status, what, config->motor[index].encoder) : 0;
}

static int open_iio(bbb_t* bbb, const bbb_imu_t* config, bbb_error_t* error) {
  const iio_imu_config_t imu = {.part = config->part,
                                .low_pass = config->dlpf,
                                .gyro_range_dps = config->gyro_range_dps,
                                .accel_range_g = config->accel_range_g,
                                .stuck_after = config->stuck_after,
                                .stale_after_ns = bbb->period_ns + bbb->late_after_ns,
                                .trigger = config->trigger};
  iio_fault_t fault;
  const int status = iio_imu_open(&bbb->iio, &imu, &fault);
  if (status < 0) return bbb_explain(error, status, "imu", fault.where, fault.advice);
  bbb->own_pace = imu_low_pass(config->part, config->dlpf)->rate_hz != config->rate_hz;
  return 0;
}

static int open_imu(bbb_t* bbb, const bbb_imu_t* config, bbb_error_t* error) {
  if (config->driver == BBB_IMU_IIO) return open_iio(bbb, config, error);
  const mpu9250_config_t imu = {.bus = config->bus,
                                .address = config->address,
                                .rate_hz = config->rate_hz,
                                .gyro_range_dps = config->gyro_range_dps,
                                .accel_range_g = config->accel_range_g,
                                .dlpf = config->dlpf,
                                .stuck_after = config->stuck_after,
                                .interrupt_active_low = config->interrupt.active_low};
  char device[BBB_NAME_MAX + 16];
  snprintf(device, sizeof device, "%s address 0x%02x", config->bus, config->address);
  const int status = mpu9250_open(&bbb->imu, &imu);
  if (status < 0) return bbb_fail(error, status, "imu", device);
  bbb->gyro_scale = config->gyro_range_dps / 2000.0;
  bbb->accel_scale = config->accel_range_g / 8.0;
  bbb->status.who_am_i = bbb->imu.who_am_i;
  bbb->status.imu_variant = bbb->imu.variant;
  return 0;
}

static int open_dmp(bbb_t* bbb, const bbb_imu_t* config, bbb_error_t* error) {
  if (config->dmp_firmware[0] == '\0') return 0;
  const bool known_range = config->accel_range_g == 2 || config->accel_range_g == 8;
  if (!known_range || config->gyro_range_dps != 2000 || config->rate_hz != 200) {
    return bbb_fail(error, -EINVAL, "dmp", "needs 2 g or 8 g, 2000 deg/s, 200 Hz");
  }
  uint8_t firmware[DMP_FIRMWARE_BYTES];
  int status = dmp_read_firmware(config->dmp_firmware, firmware);
  if (status == 0) status = dmp_start(&bbb->dmp, &bbb->imu.i2c, firmware);
  if (status < 0) return bbb_fail(error, status, "dmp", config->dmp_firmware);
  bbb->has_dmp = true;
  bbb->status.has_dmp = true;
  return 0;
}

static int open_ready(bbb_t* bbb, const bbb_imu_t* config, bbb_error_t* error) {
  if (config->driver == BBB_IMU_IIO) return 0; /* its buffer wakes the loop */
  const gpio_pin_t pin = pin_of(&config->interrupt);
  const int status =
      gpio_open_edge(&bbb->ready, &pin, config->interrupt.active_low ? GPIO_FALLING : GPIO_RISING);
  return status < 0 ? fail_pin(error, status, "imu data-ready interrupt", &config->interrupt) : 0;
}

static int open_battery(bbb_t* bbb, const bbb_config_t* config, bbb_error_t* error) {
  char device[BBB_NAME_MAX + 32];
  snprintf(device, sizeof device, "%s in_voltage%u_raw", config->adc, config->battery_channel);
  const int status = adc_open(&bbb->battery, config->adc, config->battery_channel);
  return status < 0 ? bbb_fail(error, status, "battery adc", device) : 0;
}

static int check_config(const bbb_config_t* config, bbb_error_t* error) {
  if (config->motors < 1 || config->motors > RIO_MAX_MOTORS)
    return bbb_fail(error, -EINVAL, "board", "motors");
  if (config->pwm_hz < 100 || config->pwm_hz > 100000) return bbb_fail(error, -EINVAL, "board", "pwm_hz");
  if (config->imu.rate_hz == 0) return bbb_fail(error, -EINVAL, "board", "imu rate_hz");
  if (config->imu.driver == BBB_IMU_MPU9250 && !config->imu.interrupt.used)
    return bbb_fail(error, -EINVAL, "board", "imu interrupt");
  if (config->battery_every_ticks == 0) return bbb_fail(error, -EINVAL, "board", "battery_every_ticks");
  return 0;
}

/* Bridges first: whatever fails later, the motors are already known to be off. */
static int open_all(bbb_t* bbb, const bbb_config_t* config, bbb_error_t* error) {
  int status = open_enable(bbb, config, error);
  for (uint32_t i = 0; status == 0 && i < bbb->wheels; ++i) status = open_motor(bbb, config, i, error);
  for (uint32_t i = 0; status == 0 && i < bbb->wheels; ++i) status = open_encoder(bbb, config, i, error);
  if (status == 0) status = open_battery(bbb, config, error);
  if (status == 0) status = open_imu(bbb, &config->imu, error);
  if (status == 0) status = open_dmp(bbb, &config->imu, error);
  if (status == 0) status = open_ready(bbb, &config->imu, error);
  return status;
}

int bbb_open(const bbb_config_t* config, rio_t* out, bbb_error_t* error) {
  int status = check_config(config, error);
  if (status < 0) return status;
  bbb_t* bbb = calloc(1, sizeof *bbb);
  if (bbb == NULL) return bbb_fail(error, -ENOMEM, "board", "memory");
  bbb->imu.i2c.fd = -1;
  bbb->battery.fd = -1;
  bbb->wheels = config->motors;
  bbb->period_ns = 1000000000 / config->imu.rate_hz;
  bbb->late_after_ns = (int64_t)config->imu.late_after_us * 1000;
  bbb->battery_every_ticks = config->battery_every_ticks;
  status = open_all(bbb, config, error);
  if (status < 0) {
    bbb_close(bbb);
    return status;
  }
  bbb->tick_ns = monotonic_ns();
  bbb->sample_ns = bbb->tick_ns;
  bbb->late = true; /* until the first edge */
  out->ops = &bbb_ops;
  out->self = bbb;
  return 0;
}
