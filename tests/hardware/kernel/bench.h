/* SPDX-License-Identifier: GPL-2.0 */
/* robot_bench: a robot's peripherals behind the real kernel subsystems: MPU-9250 and LSM6DSO on /dev/i2c-2,
 * two EHRPWM modules, three eQEP decoders, the ADC. In: debugfs /sys/kernel/debug/robot_bench (what the
 * sensors measure, faults). Out: what the drivers wrote. GPIO lines are gpio-sim's. Linux 6.1. */
#ifndef ROBOT_BENCH_H
#define ROBOT_BENCH_H

#include <linux/debugfs.h>
#include <linux/mutex.h>
#include <linux/types.h>

/* A fault: the next `count` operations fail with errno `error`. */
struct bench_fault {
	u32 error;
	u32 count;
};

extern struct mutex bench_lock;

int bench_take_fault(struct bench_fault *fault); /* 0 or -errno; with bench_lock held */
void bench_fault_files(const char *name, struct dentry *dir, struct bench_fault *fault);

struct i2c_msg;
struct spi_device;
void bench_lsm6dso_message(struct i2c_msg *message); /* with bench_lock held; so */
bool bench_lsm6dso_convert(const u8 *sample);

/* Reads or writes registers from *at on; with bench_lock held, both. */
void bench_imu_exchange(u8 *at, u8 *bytes, size_t size, bool read);
int bench_imu_fault(void);

int bench_spi_init(void);
void bench_spi_exit(void);
struct spi_device *bench_spi_bind(const char *driver, int irq);

int bench_imu_init(struct dentry *dir);
void bench_imu_exit(void);
int bench_pwm_init(struct dentry *dir);
void bench_pwm_exit(void);
int bench_pwm_plug(const char *name, bool in);
int bench_counter_init(struct dentry *dir);
void bench_counter_exit(void);
int bench_counter_plug(const char *name, bool in);
int bench_adc_init(struct dentry *dir);
void bench_adc_exit(void);

#endif
