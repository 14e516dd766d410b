// SPDX-License-Identifier: GPL-2.0
/* A SPI bus with the MPU-9250 on it, which the same registers answer as on I2C: for the kernel's own driver.
 */
#include <linux/module.h>
#include <linux/platform_device.h>
#include <linux/spi/spi.h>

#include "bench.h"

static struct platform_device *device;
static struct spi_controller *controller;

/* The first byte is the register, with bit 7 for reading; the rest its values and those after it. */
static int one_message(struct spi_controller *bus, struct spi_message *message)
{
	struct spi_transfer *transfer;
	bool addressed = false, read = false;
	u8 at = 0;

	mutex_lock(&bench_lock);
	message->status = bench_imu_fault();
	list_for_each_entry(transfer, &message->transfers, transfer_list)
	{
		u8 *bytes = transfer->rx_buf ? transfer->rx_buf : (u8 *)transfer->tx_buf;
		size_t size = transfer->len;

		message->actual_length += size;
		if (message->status)
			continue;
		if (!addressed && size) {
			addressed = true;
			read = *(const u8 *)transfer->tx_buf & 0x80;
			at = *(const u8 *)transfer->tx_buf & 0x7f;
			bytes++;
			size--;
		}
		bench_imu_exchange(&at, bytes, size, read);
	}
	mutex_unlock(&bench_lock);
	spi_finalize_current_message(bus);
	return 0;
}

struct spi_device *bench_spi_bind(const char *driver, int irq)
{
	struct spi_board_info info = {.max_speed_hz = 1000000, .irq = irq};

	strscpy(info.modalias, driver, sizeof(info.modalias));
	return spi_new_device(controller, &info);
}

int bench_spi_init(void)
{
	int err;

	device = platform_device_register_simple("48030000.spi", PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(device))
		return PTR_ERR(device);
	controller = spi_alloc_master(&device->dev, 0);
	if (!controller) {
		platform_device_unregister(device);
		return -ENOMEM;
	}
	controller->bus_num = -1;
	controller->num_chipselect = 1;
	controller->transfer_one_message = one_message;
	err = spi_register_controller(controller);
	if (err) {
		spi_controller_put(controller);
		platform_device_unregister(device);
	}
	return err;
}

void bench_spi_exit(void)
{
	spi_unregister_controller(controller);
	platform_device_unregister(device);
}
