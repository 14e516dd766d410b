// SPDX-License-Identifier: GPL-2.0
/* Two EHRPWM modules of two channels; the channels of one share a period, as in the hardware. */
#include <linux/module.h>
#include <linux/platform_device.h>
#include <linux/pwm.h>

#include "bench.h"

enum { MODULES = 2, CHANNELS = 2 };

struct bench_channel {
	u64 duty_ns;
	u64 period_ns;
	u64 enabled;
};

struct bench_module {
	const char *name;
	struct platform_device *device;
	struct pwm_chip chip;
	struct bench_channel *channel;
};

static struct bench_channel channels[MODULES * CHANNELS]; /* what reaches the pins */
static struct bench_module modules[MODULES] = {{.name = "48302200"}, {.name = "48304200"}};
static struct bench_fault fault;

static int apply(struct pwm_chip *chip, struct pwm_device *pwm, const struct pwm_state *state)
{
	struct bench_module *module = container_of(chip, struct bench_module, chip);
	const struct bench_channel *other = &module->channel[pwm->hwpwm ^ 1];
	struct bench_channel *channel = &module->channel[pwm->hwpwm];
	int err;

	mutex_lock(&bench_lock);
	err = bench_take_fault(&fault);
	if (!err && other->enabled && other->period_ns != state->period)
		err = -EINVAL;
	if (!err) {
		channel->duty_ns = state->duty_cycle;
		channel->period_ns = state->period;
		channel->enabled = state->enabled;
	}
	mutex_unlock(&bench_lock);
	return err;
}

static const struct pwm_ops ops = {.owner = THIS_MODULE, .apply = apply};
static struct debugfs_blob_wrapper state = {.data = channels, .size = sizeof(channels)};

static int plug(struct bench_module *module, int index)
{
	char name[24];
	int err;

	snprintf(name, sizeof(name), "%s.pwm", module->name);
	module->device = platform_device_register_simple(name, PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(module->device)) {
		err = PTR_ERR(module->device);
		module->device = NULL;
		return err;
	}
	module->channel = &channels[index * CHANNELS];
	memset(module->channel, 0, CHANNELS * sizeof(*module->channel));
	memset(&module->chip, 0, sizeof(module->chip));
	module->chip.dev = &module->device->dev;
	module->chip.ops = &ops;
	module->chip.npwm = CHANNELS;
	err = pwmchip_add(&module->chip);
	if (err) {
		platform_device_unregister(module->device);
		module->device = NULL;
	}
	return err;
}

static void unplug(struct bench_module *module)
{
	if (!module->device)
		return;
	pwmchip_remove(&module->chip);
	platform_device_unregister(module->device);
	module->device = NULL;
}

/* -ENODEV: not one of ours. */
int bench_pwm_plug(const char *name, bool in)
{
	int i;

	for (i = 0; i < MODULES; i++) {
		if (strcmp(modules[i].name, name))
			continue;
		if (!in)
			unplug(&modules[i]);
		else if (!modules[i].device)
			return plug(&modules[i], i);
		return 0;
	}
	return -ENODEV;
}

int bench_pwm_init(struct dentry *dir)
{
	int i, err = 0;

	debugfs_create_blob("pwm_state", 0444, dir, &state);
	bench_fault_files("pwm", dir, &fault);
	for (i = 0; !err && i < MODULES; i++)
		err = plug(&modules[i], i);
	if (err)
		bench_pwm_exit();
	return err;
}

void bench_pwm_exit(void)
{
	int i;

	for (i = 0; i < MODULES; i++)
		unplug(&modules[i]);
}
