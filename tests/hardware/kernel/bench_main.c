// SPDX-License-Identifier: GPL-2.0
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/string.h>
#include <linux/uaccess.h>

#include "bench.h"

DEFINE_MUTEX(bench_lock);

static struct dentry *bench_dir;

int bench_take_fault(struct bench_fault *fault)
{
	if (!fault->count)
		return 0;
	if (fault->count != U32_MAX)
		fault->count--;
	return -(int)fault->error;
}

void bench_fault_files(const char *name, struct dentry *dir, struct bench_fault *fault)
{
	char file[48];

	snprintf(file, sizeof(file), "%s_error", name);
	debugfs_create_u32(file, 0644, dir, &fault->error);
	snprintf(file, sizeof(file), "%s_error_count", name);
	debugfs_create_u32(file, 0644, dir, &fault->count);
}

/* "-48302200" takes that device away as a driver's unbinding would, "+48302200" brings it back. */
static ssize_t plug_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	char text[32] = {};
	int err;

	if (size < 2 || size >= sizeof(text))
		return -EINVAL;
	if (copy_from_user(text, from, size))
		return -EFAULT;
	if (text[0] != '+' && text[0] != '-')
		return -EINVAL;
	strim(text);
	err = bench_pwm_plug(text + 1, text[0] == '+');
	if (err == -ENODEV)
		err = bench_counter_plug(text + 1, text[0] == '+');
	return err ? err : size;
}

static const struct file_operations plug_fops = {
    .owner = THIS_MODULE,
    .write = plug_write,
};

static int __init bench_init(void)
{
	int err;

	bench_dir = debugfs_create_dir("robot_bench", NULL);
	debugfs_create_file("plug", 0200, bench_dir, NULL, &plug_fops);
	err = bench_imu_init(bench_dir);
	if (err)
		goto no_imu;
	err = bench_pwm_init(bench_dir);
	if (err)
		goto no_pwm;
	err = bench_counter_init(bench_dir);
	if (err)
		goto no_counter;
	err = bench_adc_init(bench_dir);
	if (!err)
		return 0;
	bench_counter_exit();
no_counter:
	bench_pwm_exit();
no_pwm:
	bench_imu_exit();
no_imu:
	debugfs_remove(bench_dir);
	return err;
}

static void __exit bench_exit(void)
{
	debugfs_remove(bench_dir);
	bench_adc_exit();
	bench_counter_exit();
	bench_pwm_exit();
	bench_imu_exit();
}

module_init(bench_init);
module_exit(bench_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("A balancing robot's peripherals, emulated");
MODULE_IMPORT_NS(COUNTER);
