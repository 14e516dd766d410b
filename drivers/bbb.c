#include "bbb.h"

#include <stdlib.h>
#include <string.h>

#include "bbb_internal.h"
#include "monotonic.h"

/* --- tick --- */

static void sleep_until(int64_t deadline_ns) {
  const struct timespec deadline = {.tv_sec = (time_t)(deadline_ns / 1000000000),
                                    .tv_nsec = (long)(deadline_ns % 1000000000)};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, NULL) == EINTR) {
  }
}

/* The IMU's next sample: its interrupt, or scans. As gpio_wait_edge. */
static int wait_sample(bbb_t* bbb, int64_t deadline_ns, int64_t* edge_ns) {
  return bbb->iio.devices > 0 ? iio_imu_wait(&bbb->iio, deadline_ns, edge_ns)
                              : gpio_wait_edge(&bbb->ready, deadline_ns, edge_ns);
}

static int wait_tick(void* self, int64_t* now_ns) {
  bbb_t* bbb = self;
  const int64_t due_ns = bbb->tick_ns + bbb->period_ns;
  int64_t edge_ns = 0;
  if (bbb->own_pace) sleep_until(due_ns);
  const int edges = wait_sample(bbb, due_ns + bbb->late_after_ns, &edge_ns);
  bbb->late = edges <= 0;
  bbb->imu_gone = edges < 0 && bbb->iio.devices > 0;
  if (edges > 0 && !bbb->own_pace) {
    bbb->tick_ns = edge_ns;
    bbb->sample_ns = edge_ns;
    bbb->status.missed_edges += (uint32_t)(edges - 1);
  } else {
    if (bbb->late) ++bbb->status.late_ticks;
    if (edges < 0) sleep_until(due_ns); /* a line that fails at once must not turn the loop into a spin */
    /* Keep the rhythm, but do not queue up ticks behind a stall. */
    const int64_t present_ns = monotonic_ns();
    bbb->tick_ns = present_ns - due_ns > bbb->period_ns ? present_ns : due_ns;
    if (!bbb->late) bbb->sample_ns = bbb->tick_ns;
  }
  *now_ns = monotonic_ns();
  return 0;
}

/* --- sensors --- */

static void read_iio(bbb_t* bbb, rio_sensors_t* out) {
  iio_imu_sample_t sample;
  if (iio_imu_read(&bbb->iio, &sample) < 0) {
    out->health |= RIO_IMU_LATE; /* this tick's is taken already */
    return;
  }
  memcpy(out->gyro_counts, sample.gyro_counts, sizeof out->gyro_counts);
  memcpy(out->accel_counts, sample.accel_counts, sizeof out->accel_counts);
  out->imu_temperature_degC = sample.temperature_degC;
  if (sample.clipped) out->health |= RIO_IMU_CLIPPED;
  if (sample.stuck) {
    out->health |= RIO_IMU_STUCK;
    return;
  }
  out->valid |= RIO_IMU;
}

static void read_imu(bbb_t* bbb, rio_sensors_t* out) {
  if (bbb->late) {
    out->health |= bbb->imu_gone ? RIO_IMU_BUS_ERROR : RIO_IMU_LATE;
    return;
  }
  if (bbb->iio.devices > 0) {
    read_iio(bbb, out);
    return;
  }
  mpu9250_sample_t sample;
  if (mpu9250_read(&bbb->imu, &sample) < 0) {
    out->health |= RIO_IMU_BUS_ERROR;
    return;
  }
  for (int i = 0; i < 3; ++i) {
    out->gyro_counts[i] = bbb->gyro_scale * (double)sample.gyro[i];
    out->accel_counts[i] = bbb->accel_scale * (double)sample.accel[i];
  }
  out->imu_temperature_degC = 21.0 + (double)sample.temperature / 333.87; /* RM-MPU-9250A, 4.23 */
  if ((sample.flags & MPU9250_CLIPPED) != 0)
    out->health |= RIO_IMU_CLIPPED; /* an end value is still a value */
  if ((sample.flags & MPU9250_STUCK) != 0) {
    out->health |= RIO_IMU_STUCK;
    return;
  }
  out->valid |= RIO_IMU;
}

static void read_attitude(bbb_t* bbb, rio_sensors_t* out) {
  out->attitude_wxyz[0] = 1.0;
  if (!bbb->has_dmp) return;
  dmp_packet_t packet;
  switch (dmp_poll(&bbb->dmp, &packet)) {
    case 0:
      memcpy(out->attitude_wxyz, packet.attitude_wxyz, sizeof out->attitude_wxyz);
      out->valid |= RIO_ATTITUDE;
      break;
    case -EAGAIN:
    case -EBUSY:
      break;
    case -EOVERFLOW:
      out->health |= RIO_DMP_OVERFLOW;
      break;
    case -EBADMSG:
      out->health |= RIO_DMP_BAD_PACKET;
      break;
    default:
      out->health |= RIO_IMU_BUS_ERROR;
      break;
  }
}

static void read_encoders(bbb_t* bbb, rio_sensors_t* out) {
  bool all = true;
  for (uint32_t i = 0; i < bbb->wheels; ++i) {
    int64_t counts = 0;
    if (eqep_read(&bbb->wheel[i].encoder, &counts) < 0) all = false;
    out->encoder_counts[i] = (double)(bbb->wheel[i].encoder_reversed ? -counts : counts);
  }
  if (all) {
    out->valid |= RIO_ENCODERS;
  } else {
    out->health |= RIO_ENCODER_ERROR;
  }
}

static void read_battery(bbb_t* bbb, rio_sensors_t* out) {
  if (bbb->battery_in_ticks == 0) {
    bbb->battery_status = adc_read(&bbb->battery, &bbb->battery_counts);
    bbb->battery_in_ticks = bbb->battery_every_ticks;
  }
  --bbb->battery_in_ticks;
  if (bbb->battery_status < 0) {
    out->health |= RIO_BATTERY_ERROR;
    return;
  }
  out->battery_counts = (double)bbb->battery_counts;
  out->valid |= RIO_BATTERY;
}

static void read_bridges(bbb_t* bbb, rio_sensors_t* out) {
  for (uint32_t i = 0; bbb->enabled && i < bbb->wheels; ++i) {
    if (bbb->wheel[i].type != BBB_MC33926) continue;
    bool fault = false;
    mc33926_t* motor = &bbb->wheel[i].driver.mc33926;
    if (mc33926_sample_fault(motor, &fault) < 0 || fault) out->health |= RIO_BRIDGE_FAULT;
    bbb->status.bridge_faults[i] = motor->fault.faults;
  }
}

static int read_sensors(void* self, rio_sensors_t* out) {
  bbb_t* bbb = self;
  memset(out, 0, sizeof *out);
  out->t_ns = bbb->sample_ns;
  read_imu(bbb, out);
  read_attitude(bbb, out);
  read_encoders(bbb, out);
  read_battery(bbb, out);
  read_bridges(bbb, out);
  return 0;
}

/* --- motors --- */

static int wheel_write(bbb_wheel_t* wheel, double duty) {
  return wheel->type == BBB_MC33926 ? mc33926_write(&wheel->driver.mc33926, duty)
                                    : tb6612_write(&wheel->driver.tb6612, duty);
}

static int wheel_coast(bbb_wheel_t* wheel) {
  return wheel->type == BBB_MC33926 ? mc33926_coast(&wheel->driver.mc33926)
                                    : tb6612_coast(&wheel->driver.tb6612);
}

static int set_enable(bbb_t* bbb, bool on) {
  const int status = gpio_is_open(&bbb->enable) ? gpio_set(&bbb->enable, on) : 0;
  bbb->enabled = on && status == 0;
  return status;
}

static int motors_off(void* self) {
  bbb_t* bbb = self;
  int status = set_enable(bbb, false); /* one line stops all bridges; then each, whatever the others say */
  for (uint32_t i = 0; i < bbb->wheels; ++i) {
    const int next = bbb->wheel[i].open ? wheel_coast(&bbb->wheel[i]) : 0;
    if (status == 0) status = next;
  }
  return status;
}

static int write_motors(void* self, const rio_motors_t* command) {
  bbb_t* bbb = self;
  if (!command->enable) return motors_off(self);
  int status = 0;
  for (uint32_t i = 0; status == 0 && i < bbb->wheels; ++i)
    status = wheel_write(&bbb->wheel[i], command->duty[i]);
  if (status == 0 && !bbb->enabled) status = set_enable(bbb, true);
  if (status < 0) (void)motors_off(self); /* half a command is none */
  return status;
}

void bbb_close(void* self) {
  bbb_t* bbb = self;
  (void)motors_off(bbb);
  for (uint32_t i = 0; i < bbb->wheels; ++i) {
    bbb_wheel_t* wheel = &bbb->wheel[i];
    eqep_close(&wheel->encoder);
    if (!wheel->open) continue;
    if (wheel->type == BBB_MC33926) {
      mc33926_close(&wheel->driver.mc33926);
    } else {
      tb6612_close(&wheel->driver.tb6612);
    }
  }
  if (gpio_is_open(&bbb->enable)) gpio_close(&bbb->enable);
  if (gpio_is_open(&bbb->ready)) gpio_close(&bbb->ready);
  adc_close(&bbb->battery);
  iio_imu_close(&bbb->iio);
  mpu9250_close(&bbb->imu);
  free(bbb);
}

const rio_ops_t bbb_ops = {wait_tick, read_sensors, write_motors, motors_off, bbb_close};

void bbb_get_status(const rio_t* io, bbb_status_t* out) { *out = ((const bbb_t*)io->self)->status; }
