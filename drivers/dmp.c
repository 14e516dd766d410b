#include "dmp.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "monotonic.h"
#include "mpu9250_registers.h"

enum { DMP_CHUNK = 16, DMP_BANK_BYTES = 256, DMP_MAX_SETTING = 12, DMP_SAMPLE_HZ = 200 };

typedef struct dmp_setting {
  uint16_t address;
  uint8_t length;
  uint8_t bytes[DMP_MAX_SETTING];
} dmp_setting_t;

/* Chip axes are kept as they are (the mount rotation is the core's business), 6-axis quaternion, gesture
 * word, gyro calibration at rest, one packet and one interrupt per 200 Hz sample. */
static const dmp_setting_t kSettings[] = {
    {1062, 3, {0x4C, 0xCD, 0x6C}},                                            /* gyro axes x, y, z */
    {1066, 3, {0x0C, 0xC9, 0x2C}},                                            /* accel axes x, y, z */
    {1088, 3, {0x36, 0x56, 0x76}},                                            /* gyro signs + + + */
    {1073, 3, {0x26, 0x46, 0x66}},                                            /* accel signs + + + */
    {104, 4, {0x02, 0xCA, 0xE3, 0x09}},                                       /* integration scale, 200 Hz */
    {2727, 10, {0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3, 0xA3}}, /* no raw data in the packet */
    {2742, 1, {0x20}},                                                        /* gesture word in the packet */
    {1208, 9, {0xB8, 0xAA, 0xB3, 0x8D, 0xB4, 0x98, 0x0D, 0x35, 0x5D}},        /* gyro calibration on */
    {2224, 1, {0xF8}},                           /* tap on: keeps the FIFO rate */
    {1853, 1, {0xD8}},                           /* screen orientation off */
    {2712, 4, {0x8B, 0x8B, 0x8B, 0x8B}},         /* gyro-only quaternion off */
    {2718, 4, {0x20, 0x28, 0x30, 0x38}},         /* 6-axis quaternion on */
    {512 + 22, 2, {0, 200 / DMP_SAMPLE_HZ - 1}}, /* FIFO rate divider */
    {2753, 12, {0xFE, 0xF2, 0xAB, 0xC4, 0xAA, 0xF1, 0xDF, 0xDF, 0xBB, 0xAF, 0xDF, 0xDF}}, /* after the FIFO */
    {2690, 11, {0xD8, 0xB1, 0xB9, 0xF3, 0x8B, 0xA3, 0x91, 0xB6, 0x09, 0xB4, 0xD9}}, /* interrupt per packet */
};

static int32_t big_endian_32(const uint8_t* b) {
  return (int32_t)((uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | (uint32_t)b[3]);
}

static int16_t big_endian_16(const uint8_t* b) { return (int16_t)(uint16_t)(b[0] << 8 | b[1]); }

int dmp_parse(const uint8_t* bytes, size_t length, dmp_packet_t* out) {
  if (length != DMP_PACKET_BYTES && length != DMP_PACKET_RAW_BYTES) return -EMSGSIZE;
  dmp_packet_t packet = {.has_raw = length == DMP_PACKET_RAW_BYTES};
  int64_t norm_q28 = 0;
  double norm = 0.0;
  for (size_t i = 0; i < 4; ++i) {
    const int32_t q30 = big_endian_32(bytes + 4 * i);
    const int64_t q14 = q30 >> 16;
    norm_q28 += q14 * q14;
    packet.attitude_wxyz[i] = (double)q30 / (double)(1 << 30);
    norm += packet.attitude_wxyz[i] * packet.attitude_wxyz[i];
  }
  if (norm_q28 < (1 << 28) - (1 << 16) || norm_q28 > (1 << 28) + (1 << 16)) return -EBADMSG;
  for (int i = 0; i < 4; ++i) packet.attitude_wxyz[i] /= sqrt(norm);
  for (size_t i = 0; packet.has_raw && i < 3; ++i) {
    packet.accel[i] = big_endian_16(bytes + 16 + 2 * i);
    packet.gyro[i] = big_endian_16(bytes + 22 + 2 * i);
  }
  *out = packet;
  return 0;
}

int dmp_read_firmware(const char* path, uint8_t out[DMP_FIRMWARE_BYTES]) {
  const int fd = open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return -errno;
  size_t have = 0;
  int status = 0;
  while (status == 0 && have < DMP_FIRMWARE_BYTES) {
    const ssize_t n = read(fd, out + have, DMP_FIRMWARE_BYTES - have);
    if (n < 0) status = -errno;
    if (n == 0) status = -ENODATA;
    if (n > 0) have += (size_t)n;
  }
  uint8_t one_more = 0;
  if (status == 0 && read(fd, &one_more, 1) != 0) status = -EFBIG;
  close(fd);
  return status;
}

/* Memory is addressed by bank and offset; a chunk must stay in its bank. */
static int write_memory(const i2c_dev_t* i2c, uint16_t address, const uint8_t* data, uint8_t length) {
  if (address % DMP_BANK_BYTES + length > DMP_BANK_BYTES) return -EINVAL;
  const uint8_t bank[2] = {(uint8_t)(address >> 8), (uint8_t)address};
  const int status = i2c_dev_write(i2c, MPU9250_DMP_BANK, bank, 2);
  return status < 0 ? status : i2c_dev_write(i2c, MPU9250_DMP_DATA, data, length);
}

static int verify_memory(const i2c_dev_t* i2c, uint16_t address, const uint8_t* data, uint8_t length) {
  const uint8_t bank[2] = {(uint8_t)(address >> 8), (uint8_t)address};
  uint8_t kept[DMP_CHUNK] = {0};
  int status = i2c_dev_write(i2c, MPU9250_DMP_BANK, bank, 2);
  if (status == 0) status = i2c_dev_read(i2c, MPU9250_DMP_DATA, kept, length);
  if (status < 0) return status;
  return memcmp(kept, data, length) == 0 ? 0 : -EILSEQ;
}

static int load_memory(const i2c_dev_t* i2c, uint16_t address, const uint8_t* data, uint8_t length) {
  const int status = write_memory(i2c, address, data, length);
  return status < 0 ? status : verify_memory(i2c, address, data, length);
}

static int load_firmware(const i2c_dev_t* i2c, const uint8_t firmware[DMP_FIRMWARE_BYTES]) {
  for (int at = 0; at < DMP_FIRMWARE_BYTES; at += DMP_CHUNK) {
    const int left = DMP_FIRMWARE_BYTES - at;
    const int status =
        load_memory(i2c, (uint16_t)at, firmware + at, (uint8_t)(left < DMP_CHUNK ? left : DMP_CHUNK));
    if (status < 0) return status;
  }
  const uint8_t start[2] = {0x04, 0x00};
  return i2c_dev_write(i2c, MPU9250_DMP_START, start, 2);
}

static int set_control(const dmp_t* dmp, uint8_t user_control) {
  return i2c_dev_write_byte(dmp->i2c, MPU9250_USER_CTRL, user_control);
}

static int set_interrupt(const dmp_t* dmp, uint8_t source) {
  return i2c_dev_write_byte(dmp->i2c, MPU9250_INT_ENABLE, source);
}

static int run(dmp_t* dmp) {
  int status = set_control(dmp, MPU9250_DMP_ENABLE | MPU9250_FIFO_ENABLE);
  if (status == 0) status = set_interrupt(dmp, MPU9250_INT_DMP);
  if (status == 0) dmp->state = DMP_RUNNING;
  return status;
}

/* The packets must find the room that the backlog's limit counts on. */
static int set_fifo_size(const i2c_dev_t* i2c) {
  uint8_t accel = 0;
  const int status = i2c_dev_read(i2c, MPU9250_ACCEL_CONFIG_2, &accel, 1);
  if (status < 0) return status;
  accel = (uint8_t)((accel & ~MPU9250_FIFO_SIZE_MASK) | MPU9250_FIFO_1024);
  return i2c_dev_write_byte(i2c, MPU9250_ACCEL_CONFIG_2, accel);
}

int dmp_start(dmp_t* dmp, const i2c_dev_t* i2c, const uint8_t firmware[DMP_FIRMWARE_BYTES]) {
  memset(dmp, 0, sizeof *dmp);
  dmp->i2c = i2c;
  int status = set_interrupt(dmp, 0);
  if (status == 0) status = i2c_dev_write_byte(i2c, MPU9250_FIFO_EN, 0);
  if (status == 0) status = set_control(dmp, 0);
  if (status == 0) status = set_fifo_size(i2c);
  if (status == 0) status = load_firmware(i2c, firmware);
  for (size_t i = 0; status == 0 && i < sizeof kSettings / sizeof *kSettings; ++i) {
    status = load_memory(i2c, kSettings[i].address, kSettings[i].bytes, kSettings[i].length);
  }
  if (status == 0) status = set_control(dmp, MPU9250_FIFO_RESET | MPU9250_DMP_RESET);
  if (status < 0) return status;
  sleep_ms(50);
  return run(dmp);
}

/* The FIFO alone first, with the DMP running on; after several vain attempts the DMP too, and meanwhile raw
 * samples drive the interrupt so that the loop keeps its tick. */
static void begin_reset(dmp_t* dmp) {
  if (dmp->soft_resets < DMP_MAX_SOFT_RESETS) {
    ++dmp->soft_resets;
    dmp->state = DMP_CLEARING;
    dmp->wait_ticks = 1;
    (void)set_control(dmp, MPU9250_DMP_ENABLE | MPU9250_FIFO_RESET);
    return;
  }
  dmp->soft_resets = 0;
  dmp->state = DMP_RESTARTING;
  dmp->has_last = false; /* it starts again from yaw 0 */
  dmp->wait_ticks = DMP_RESTART_TICKS;
  (void)set_interrupt(dmp, MPU9250_INT_RAW_READY);
  (void)set_control(dmp, MPU9250_FIFO_RESET | MPU9250_DMP_RESET);
}

static int continue_reset(dmp_t* dmp) {
  if (dmp->wait_ticks > 0) --dmp->wait_ticks;
  if (dmp->wait_ticks > 0) return -EBUSY;
  const int status = run(dmp); /* on a bus error the next tick tries again */
  return status < 0 ? status : -EBUSY;
}

/* A shifted packet stream passes the norm test when one component is near 0, as on an upright robot; but it
 * jumps. At 2000 deg/s, the gyro's range, four ticks turn 40 deg; the limit is 52. */
static bool is_continuous(const dmp_t* dmp, const dmp_packet_t* packet) {
  const double min_dot = 0.9;
  const unsigned max_ticks = 4;
  if (!dmp->has_last || (dmp->ticks_since_good > max_ticks && dmp->soft_resets == 0)) return true;
  double dot = 0.0;
  for (int i = 0; i < 4; ++i) dot += dmp->last_wxyz[i] * packet->attitude_wxyz[i];
  return fabs(dot) >= min_dot;
}

static int accept(dmp_t* dmp, const uint8_t* bytes, dmp_packet_t* out) {
  dmp_packet_t packet;
  const int status = dmp_parse(bytes, DMP_PACKET_BYTES, &packet);
  if (status < 0) return status;
  if (!is_continuous(dmp, &packet)) return -EBADMSG;
  dmp->soft_resets = 0;
  dmp->ticks_since_good = 0;
  dmp->has_last = true;
  memcpy(dmp->last_wxyz, packet.attitude_wxyz, sizeof dmp->last_wxyz);
  *out = packet;
  return 0;
}

int dmp_poll(dmp_t* dmp, dmp_packet_t* out) {
  ++dmp->ticks_since_good;
  if (dmp->state != DMP_RUNNING) return continue_reset(dmp);
  uint8_t bytes[DMP_MAX_BACKLOG * DMP_PACKET_BYTES];
  int status = i2c_dev_read(dmp->i2c, MPU9250_FIFO_COUNT_H, bytes, 2);
  if (status < 0) return status;
  /* A packet still being written is left for the next tick: whole packets keep the FIFO aligned. */
  const unsigned packets = (unsigned)((bytes[0] & 0x1F) << 8 | bytes[1]) / DMP_PACKET_BYTES;
  if (packets == 0) return -EAGAIN;
  if (packets > DMP_MAX_BACKLOG) {
    begin_reset(dmp);
    return -EOVERFLOW;
  }
  status = i2c_dev_read(dmp->i2c, MPU9250_FIFO_R_W, bytes, (uint16_t)(packets * DMP_PACKET_BYTES));
  if (status == 0) status = accept(dmp, bytes + (size_t)(packets - 1) * DMP_PACKET_BYTES, out);
  if (status < 0) begin_reset(dmp); /* half a transfer leaves the FIFO misaligned, like a bad packet */
  return status;
}
