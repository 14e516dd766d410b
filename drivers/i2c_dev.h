/* i2c_dev.h: register access to one chip on an I2C bus through /dev/i2c-N and I2C_RDWR: one system call per
 * transfer. In: register, bytes. Out: bytes; 0 or -errno (-ENXIO or -EREMOTEIO: no acknowledge, -EIO: short
 * transfer). Real-time safe after open, as far as the bus is: 14 bytes take about 0.4 ms at 400 kHz. */
#ifndef EQUIPOISE_DRIVERS_I2C_DEV_H
#define EQUIPOISE_DRIVERS_I2C_DEV_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { I2C_DEV_MAX_WRITE = 32 };

typedef struct i2c_dev {
  int fd;
  uint16_t address;
} i2c_dev_t;

int i2c_dev_open(i2c_dev_t* dev, const char* bus,
                 uint16_t address); /* -EOPNOTSUPP: adapter without plain I2C */
int i2c_dev_read(const i2c_dev_t* dev, uint8_t reg, uint8_t* out, uint16_t length);
int i2c_dev_write(const i2c_dev_t* dev, uint8_t reg, const uint8_t* data, uint16_t length);
int i2c_dev_write_byte(const i2c_dev_t* dev, uint8_t reg, uint8_t value);
void i2c_dev_close(i2c_dev_t* dev);

#ifdef __cplusplus
}
#endif

#endif
