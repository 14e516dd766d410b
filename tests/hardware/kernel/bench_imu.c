// SPDX-License-Identifier: GPL-2.0
/* MPU-9250 at address 0x68 of /dev/i2c-2: register file, reset, DMP memory, FIFO of 1024 bytes, interrupt.
 * For the kernel's own driver, which imu_driver binds: "mpu6500", "lsm6dso", "spi:mpu6500", or "" to let go.
 */
#include <linux/fs.h>
#include <linux/i2c.h>
#include <linux/interrupt.h>
#include <linux/irq.h>
#include <linux/irq_sim.h>
#include <linux/irqdomain.h>
#include <linux/module.h>
#include <linux/platform_device.h>
#include <linux/spi/spi.h>
#include <linux/uaccess.h>

#include "bench.h"

enum { ADDRESS = 0x68, LSM6DSO = 0x6a, FIFO_BYTES = 1024, DMP_BYTES = 4096 };
enum {
	FIFO_EN = 0x23,
	INT_ENABLE = 0x38,
	INT_STATUS = 0x3a,
	SAMPLE = 0x3b,
	SAMPLE_BYTES = 14,
	USER_CTRL = 0x6a,
	POWER = 0x6b,
	BANK = 0x6d,
	OFFSET = 0x6e,
	DATA = 0x6f,
	FIFO_COUNT_H = 0x72,
	FIFO_COUNT_L = 0x73,
	FIFO = 0x74,
	WHO_AM_I = 0x75
};

static u8 reg[128], pointer, who_am_i = 0x71;
static u8 sample[SAMPLE_BYTES]; /* what the sensor measures; the registers show it while it is awake */
static u8 dmp[DMP_BYTES];
static u8 fifo[FIFO_BYTES];
static unsigned int fifo_head, fifo_size;
static u32 transfers;
static struct bench_fault fault;
static struct irq_domain *domain; /* of the chip's interrupt pin */
static struct i2c_client *client; /* whose driver serves the chip; else /dev/i2c-2 does */
static struct spi_device *on_spi; /* the same on the other bus */

static void reset(void)
{
	memset(reg, 0, sizeof(reg));
	reg[POWER] = 0x01;
	fifo_size = 0;
}

static u8 *dmp_cell(void)
{
	return &dmp[(reg[BANK] << 8 | reg[OFFSET]++) % DMP_BYTES];
}

static void store(u8 at, u8 value)
{
	if (at == DATA) {
		*dmp_cell() = value;
		return;
	}
	if (at == POWER && (value & 0x80)) {
		reset();
		return;
	}
	if (at == USER_CTRL) {
		if (value & 0x04)
			fifo_size = 0;
		value &= ~0x0d; /* reset bits clear themselves */
	}
	reg[at & 0x7f] = value;
}

static u8 load(u8 at)
{
	u8 value;

	switch (at) {
	case DATA:
		return *dmp_cell();
	case WHO_AM_I:
		return who_am_i;
	case FIFO_COUNT_H:
		return fifo_size >> 8;
	case FIFO_COUNT_L:
		return fifo_size & 0xff;
	case FIFO:
		if (!fifo_size)
			return 0xff;
		value = fifo[fifo_head];
		fifo_head = (fifo_head + 1) % FIFO_BYTES;
		fifo_size--;
		return value;
	case INT_STATUS:
		value = reg[INT_STATUS];
		reg[INT_STATUS] = 0;
		return value;
	}
	if (at >= SAMPLE && at < SAMPLE + SAMPLE_BYTES)
		return reg[POWER] & 0x40 ? 0 : sample[at - SAMPLE];
	return reg[at & 0x7f];
}

void bench_imu_exchange(u8 *at, u8 *bytes, size_t size, bool read)
{
	size_t i;

	for (i = 0; i < size; i++) {
		if (read)
			bytes[i] = load(*at);
		else
			store(*at, bytes[i]);
		if (*at != DATA && *at != FIFO)
			++*at;
	}
}

int bench_imu_fault(void)
{
	return bench_take_fault(&fault);
}

static void one_message(struct i2c_msg *message)
{
	bool read = message->flags & I2C_M_RD;
	int addressed = !read && message->len;

	if (addressed)
		pointer = message->buf[0];
	bench_imu_exchange(&pointer, message->buf + addressed, message->len - addressed, read);
}

static int transfer(struct i2c_adapter *adapter, struct i2c_msg *messages, int count)
{
	int i, err;

	mutex_lock(&bench_lock);
	transfers++;
	err = bench_take_fault(&fault);
	for (i = 0; !err && i < count; i++) {
		if (messages[i].addr == ADDRESS)
			one_message(&messages[i]);
		else if (messages[i].addr == LSM6DSO)
			bench_lsm6dso_message(&messages[i]);
		else
			err = -ENXIO;
	}
	mutex_unlock(&bench_lock);
	return err ? err : count;
}

static u32 functionality(struct i2c_adapter *adapter)
{
	return I2C_FUNC_I2C | I2C_FUNC_SMBUS_EMUL;
}

static const struct i2c_algorithm algorithm = {.master_xfer = transfer, .functionality = functionality};
static struct i2c_adapter adapter = {
    .owner = THIS_MODULE, .name = "robot_bench I2C2", .algo = &algorithm, .nr = 2};
static struct platform_device *controller; /* by its name udev knows the IMU's bus */

/* 14 bytes as the chip delivers them: accel, temperature, gyro, big-endian. */
static ssize_t sample_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	u8 bytes[SAMPLE_BYTES];

	if (size != sizeof(bytes))
		return -EINVAL;
	if (copy_from_user(bytes, from, sizeof(bytes)))
		return -EFAULT;
	mutex_lock(&bench_lock);
	memcpy(sample, bytes, sizeof(bytes));
	mutex_unlock(&bench_lock);
	return size;
}

static void push(const u8 *bytes, size_t size)
{
	size_t i;

	for (i = 0; i < size && (reg[USER_CTRL] & 0x40); i++) {
		fifo[(fifo_head + fifo_size) % FIFO_BYTES] = bytes[i];
		if (fifo_size < FIFO_BYTES)
			fifo_size++;
		else
			fifo_head = (fifo_head + 1) % FIFO_BYTES; /* the oldest is lost */
	}
}

static ssize_t fifo_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	u8 bytes[64];

	if (size > sizeof(bytes))
		return -EINVAL;
	if (copy_from_user(bytes, from, size))
		return -EFAULT;
	mutex_lock(&bench_lock);
	push(bytes, size);
	mutex_unlock(&bench_lock);
	return size;
}

/* A conversion has ended: into the FIFO what FIFO_EN names, in the order of the registers; then the pin. */
static ssize_t data_ready_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	bool raise;

	mutex_lock(&bench_lock);
	if (!(reg[POWER] & 0x40)) {
		if (reg[FIFO_EN] & 0x08)
			push(sample, 6);
		if (reg[FIFO_EN] & 0x80)
			push(sample + 6, 2);
		if ((reg[FIFO_EN] & 0x70) == 0x70)
			push(sample + 8, 6);
		reg[INT_STATUS] |= 0x01;
	}
	raise = reg[INT_STATUS] & reg[INT_ENABLE] & 0x01;
	raise |= bench_lsm6dso_convert(sample);
	mutex_unlock(&bench_lock);
	if (raise)
		irq_set_irqchip_state(irq_find_mapping(domain, 0), IRQCHIP_STATE_PENDING, true);
	return size;
}

static void unbind(void)
{
	i2c_unregister_device(client);
	client = NULL;
	spi_unregister_device(on_spi);
	on_spi = NULL;
}

static ssize_t driver_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	struct i2c_board_info info = {.addr = ADDRESS, .irq = irq_find_mapping(domain, 0)};
	char name[I2C_NAME_SIZE] = {};

	if (size >= sizeof(name))
		return -EINVAL;
	if (copy_from_user(name, from, size))
		return -EFAULT;
	strscpy(info.type, strim(name), sizeof(info.type));
	unbind();
	if (!*info.type)
		return size;
	if (!strncmp(info.type, "spi:", 4)) {
		on_spi = bench_spi_bind(info.type + 4, info.irq);
		return on_spi ? size : -ENODEV;
	}
	if (!strcmp(info.type, "lsm6dso"))
		info.addr = LSM6DSO;
	client = i2c_new_client_device(&adapter, &info);
	if (!IS_ERR(client))
		return size;
	client = NULL;
	return -ENODEV;
}

static const struct file_operations data_ready_fops = {.owner = THIS_MODULE, .write = data_ready_write};
static const struct file_operations driver_fops = {.owner = THIS_MODULE, .write = driver_write};
static const struct file_operations sample_fops = {.owner = THIS_MODULE, .write = sample_write};
static const struct file_operations fifo_fops = {.owner = THIS_MODULE, .write = fifo_write};
static struct debugfs_blob_wrapper registers = {.data = reg, .size = sizeof(reg)};

int bench_imu_init(struct dentry *dir)
{
	int err;

	domain = irq_domain_create_sim(NULL, 1);
	if (IS_ERR(domain))
		return PTR_ERR(domain);
	err = irq_create_mapping(domain, 0) ? 0 : -ENOMEM;
	if (err)
		goto no_irq;
	irq_set_irq_type(irq_find_mapping(domain, 0), IRQ_TYPE_EDGE_RISING);
	reset();
	err = bench_spi_init();
	if (err)
		goto no_spi;
	debugfs_create_file("imu_sample", 0200, dir, NULL, &sample_fops);
	debugfs_create_file("imu_fifo", 0200, dir, NULL, &fifo_fops);
	debugfs_create_file("imu_data_ready", 0200, dir, NULL, &data_ready_fops);
	debugfs_create_file("imu_driver", 0200, dir, NULL, &driver_fops);
	debugfs_create_blob("imu_registers", 0444, dir, &registers);
	debugfs_create_u8("imu_who_am_i", 0644, dir, &who_am_i);
	debugfs_create_u32("imu_transfers", 0444, dir, &transfers);
	bench_fault_files("imu", dir, &fault);
	controller = platform_device_register_simple("4819c000.i2c", PLATFORM_DEVID_NONE, NULL, 0);
	err = PTR_ERR_OR_ZERO(controller);
	if (err)
		goto no_controller;
	adapter.dev.parent = &controller->dev;
	err = i2c_add_numbered_adapter(&adapter);
	if (!err)
		return 0;
	platform_device_unregister(controller);
no_controller:
	bench_spi_exit();
no_spi:
	irq_dispose_mapping(irq_find_mapping(domain, 0));
no_irq:
	irq_domain_remove_sim(domain);
	return err;
}

void bench_imu_exit(void)
{
	unbind();
	i2c_del_adapter(&adapter);
	platform_device_unregister(controller);
	bench_spi_exit();
	irq_dispose_mapping(irq_find_mapping(domain, 0));
	irq_domain_remove_sim(domain);
}
