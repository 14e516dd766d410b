#include "mpu9250.h"

#include <errno.h>
#include <string.h>

#include "monotonic.h"
#include "mpu9250_registers.h"

static int16_t big_endian(const uint8_t* bytes) { return (int16_t)(uint16_t)(bytes[0] << 8 | bytes[1]); }

/* value = base << code, code 0 .. 3; -1 if there is no such code. */
static int range_code(uint16_t value, uint16_t base) {
  for (int code = 0; code < 4; ++code) {
    if (value == (uint16_t)(base << code)) return code;
  }
  return -1;
}

static int check_chip(mpu9250_t* imu) {
  const int status = i2c_dev_read(&imu->i2c, MPU9250_WHO_AM_I, &imu->who_am_i, 1);
  if (status < 0) return status;
  imu->variant = imu->who_am_i == MPU9250_WHO_9255 || imu->who_am_i == MPU9250_WHO_6500;
  return imu->who_am_i == MPU9250_WHO_9250 || imu->variant ? 0 : -ENODEV;
}

static int reset_chip(const mpu9250_t* imu) {
  int status = i2c_dev_write_byte(&imu->i2c, MPU9250_PWR_MGMT_1, MPU9250_RESET);
  if (status < 0) return status;
  sleep_ms(100); /* the register map asks for 100 ms */
  status = i2c_dev_write_byte(&imu->i2c, MPU9250_PWR_MGMT_1, MPU9250_CLOCK_AUTO);
  sleep_ms(50); /* gyro start-up takes 35 ms */
  return status;
}

static int configure(const mpu9250_t* imu, const mpu9250_config_t* config) {
  const int gyro = range_code(config->gyro_range_dps, 250);
  const int accel = range_code(config->accel_range_g, 2);
  const uint8_t settings[][2] = {
      {MPU9250_SMPLRT_DIV, (uint8_t)(1000 / config->rate_hz - 1)},
      {MPU9250_CONFIG, config->dlpf},
      {MPU9250_GYRO_CONFIG, (uint8_t)(gyro << 3)},
      {MPU9250_ACCEL_CONFIG, (uint8_t)(accel << 3)},
      {MPU9250_ACCEL_CONFIG_2, config->dlpf},
      /* A pulse, not a latched level: a lost edge must not be the last one. */
      {MPU9250_INT_PIN_CFG, config->interrupt_active_low ? MPU9250_INT_LOW : 0},
      {MPU9250_INT_ENABLE, MPU9250_INT_RAW_READY},
  };
  for (size_t i = 0; i < sizeof settings / sizeof *settings; ++i) {
    uint8_t kept = 0;
    int status = i2c_dev_write_byte(&imu->i2c, settings[i][0], settings[i][1]);
    if (status == 0) status = i2c_dev_read(&imu->i2c, settings[i][0], &kept, 1);
    if (status < 0) return status;
    if (kept != settings[i][1]) return -EIO;
  }
  return 0;
}

static int check_config(const mpu9250_config_t* config) {
  if (config->rate_hz < 4 || config->rate_hz > 1000 || 1000 % config->rate_hz != 0) return -EINVAL;
  if (config->dlpf < 1 || config->dlpf > 6) return -EINVAL;
  return range_code(config->gyro_range_dps, 250) < 0 || range_code(config->accel_range_g, 2) < 0 ? -EINVAL
                                                                                                 : 0;
}

int mpu9250_open(mpu9250_t* imu, const mpu9250_config_t* config) {
  memset(imu, 0, sizeof *imu);
  imu->i2c.fd = -1;
  imu->repeats.stuck_after = config->stuck_after;
  int status = check_config(config);
  if (status == 0) status = i2c_dev_open(&imu->i2c, config->bus, config->address);
  if (status < 0) return status;
  status = check_chip(imu);
  if (status == 0) status = reset_chip(imu);
  if (status == 0) status = configure(imu, config);
  if (status < 0) i2c_dev_close(&imu->i2c);
  return status;
}

static bool at_range_end(int16_t value) { return value == INT16_MAX || value == INT16_MIN; }

int mpu9250_read(mpu9250_t* imu, mpu9250_sample_t* out) {
  uint8_t bytes[14];
  const int status = i2c_dev_read(&imu->i2c, MPU9250_ACCEL_XOUT_H, bytes, sizeof bytes);
  if (status < 0) return status;
  out->flags = 0;
  out->temperature = big_endian(bytes + 6);
  int32_t axes[6]; /* without the temperature, which may stand still */
  for (size_t i = 0; i < 3; ++i) {
    axes[i] = out->accel[i] = big_endian(bytes + 2 * i);
    axes[3 + i] = out->gyro[i] = big_endian(bytes + 8 + 2 * i);
    if (at_range_end(out->accel[i]) || at_range_end(out->gyro[i])) out->flags |= MPU9250_CLIPPED;
  }
  if (repeats_stuck(&imu->repeats, axes)) out->flags |= MPU9250_STUCK;
  return 0;
}

void mpu9250_close(mpu9250_t* imu) {
  if (imu->i2c.fd < 0) return;
  (void)i2c_dev_write_byte(&imu->i2c, MPU9250_INT_ENABLE, 0);
  (void)i2c_dev_write_byte(&imu->i2c, MPU9250_USER_CTRL, 0);
  (void)i2c_dev_write_byte(&imu->i2c, MPU9250_PWR_MGMT_1, MPU9250_SLEEP);
  i2c_dev_close(&imu->i2c);
}
