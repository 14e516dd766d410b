// SPDX-License-Identifier: GPL-2.0
/* The AM335x ADC's eight inputs as an IIO device of its name. */
#include <linux/iio/iio.h>
#include <linux/module.h>
#include <linux/platform_device.h>

#include "bench.h"

enum { INPUTS = 8 };

static struct platform_device *device;
static struct iio_dev *iio;
static u32 counts[INPUTS];
static struct bench_fault fault;

static int read_raw(struct iio_dev *dev, struct iio_chan_spec const *channel, int *value, int *value2,
		    long mask)
{
	int err;

	if (mask != IIO_CHAN_INFO_RAW)
		return -EINVAL;
	mutex_lock(&bench_lock);
	err = bench_take_fault(&fault);
	*value = counts[channel->channel];
	mutex_unlock(&bench_lock);
	return err ? err : IIO_VAL_INT;
}

#define INPUT(n)                                                                                             \
	{                                                                                                    \
		.type = IIO_VOLTAGE, .indexed = 1, .channel = (n),                                           \
		.info_mask_separate = BIT(IIO_CHAN_INFO_RAW)                                                 \
	}
static const struct iio_info info = {.read_raw = read_raw};
static const struct iio_chan_spec inputs[INPUTS] = {INPUT(0), INPUT(1), INPUT(2), INPUT(3),
						    INPUT(4), INPUT(5), INPUT(6), INPUT(7)};

int bench_adc_init(struct dentry *dir)
{
	int i, err;

	device = platform_device_register_simple("44e0d000.adc", PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(device))
		return PTR_ERR(device);
	iio = iio_device_alloc(&device->dev, 0);
	if (!iio) {
		platform_device_unregister(device);
		return -ENOMEM;
	}
	iio->name = "TI-am335x-adc.0.auto";
	iio->info = &info;
	iio->modes = INDIO_DIRECT_MODE;
	iio->channels = inputs;
	iio->num_channels = INPUTS;
	err = iio_device_register(iio);
	if (err) {
		iio_device_free(iio);
		platform_device_unregister(device);
		return err;
	}
	for (i = 0; i < INPUTS; i++) {
		char name[8];

		snprintf(name, sizeof(name), "adc%d", i);
		debugfs_create_u32(name, 0644, dir, &counts[i]);
	}
	bench_fault_files("adc", dir, &fault);
	return 0;
}

void bench_adc_exit(void)
{
	iio_device_unregister(iio);
	iio_device_free(iio);
	platform_device_unregister(device);
}
