#include "i2c_dev.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

int i2c_dev_open(i2c_dev_t* dev, const char* bus, uint16_t address) {
  dev->address = address;
  dev->fd = open(bus, O_RDWR | O_CLOEXEC);
  if (dev->fd < 0) return -errno;
  unsigned long functions = 0;
  int status = 0;
  if (ioctl(dev->fd, I2C_FUNCS, &functions) < 0) {
    status = -errno;
  } else if ((functions & I2C_FUNC_I2C) == 0) {
    status = -EOPNOTSUPP;
  }
  if (status < 0) i2c_dev_close(dev);
  return status;
}

static int transfer(const i2c_dev_t* dev, struct i2c_msg* messages, uint32_t count) {
  struct i2c_rdwr_ioctl_data data = {.msgs = messages, .nmsgs = count};
  const int done = ioctl(dev->fd, I2C_RDWR, &data);
  if (done < 0) return -errno;
  return (uint32_t)done == count ? 0 : -EIO;
}

int i2c_dev_read(const i2c_dev_t* dev, uint8_t reg, uint8_t* out, uint16_t length) {
  struct i2c_msg messages[2] = {
      {.addr = dev->address, .flags = 0, .len = 1, .buf = &reg},
      {.addr = dev->address, .flags = I2C_M_RD, .len = length, .buf = out},
  };
  return transfer(dev, messages, 2);
}

int i2c_dev_write(const i2c_dev_t* dev, uint8_t reg, const uint8_t* data, uint16_t length) {
  uint8_t bytes[1 + I2C_DEV_MAX_WRITE];
  if (length > I2C_DEV_MAX_WRITE) return -EMSGSIZE;
  bytes[0] = reg;
  memcpy(bytes + 1, data, length);
  struct i2c_msg message = {.addr = dev->address, .flags = 0, .len = (uint16_t)(length + 1), .buf = bytes};
  return transfer(dev, &message, 1);
}

int i2c_dev_write_byte(const i2c_dev_t* dev, uint8_t reg, uint8_t value) {
  return i2c_dev_write(dev, reg, &value, 1);
}

void i2c_dev_close(i2c_dev_t* dev) {
  if (dev->fd >= 0) close(dev->fd);
  dev->fd = -1;
}
