// SPDX-License-Identifier: GPL-2.0
/* QEMU's SJA1000 has no error counters, for its bus never fails. This puts them in front of it: "can0 130"
 * into debugfs can_errors/transmit sets that controller's transmit error counter, and status, interrupt and
 * counter registers then read as the chip's would. Counters fall to 0 when the driver resets the chip.
 * Everything else is the kernel's own: the SJA1000 driver, error frames, bus-off, restart. Linux 6.1. */
#include <linux/can/dev.h>
#include <linux/debugfs.h>
#include <linux/interrupt.h>
#include <linux/module.h>
#include <linux/netdevice.h>
#include <linux/rtnetlink.h>
#include <linux/uaccess.h>

#include "sja1000.h"

enum { CONTROLLERS = 2, WARNING = 96, PASSIVE = 128, BUS_OFF = 256 };

struct controller {
	struct net_device *dev;
	u8 (*read_reg)(const struct sja1000_priv *priv, int reg);
	void (*write_reg)(const struct sja1000_priv *priv, int reg, u8 value);
	unsigned int errors;
	u8 interrupts;
};

static struct controller controllers[CONTROLLERS];
static struct dentry *dir;

static struct controller *controller_of(const struct sja1000_priv *priv)
{
	return &controllers[priv->dev == controllers[1].dev];
}

static u8 read_reg(const struct sja1000_priv *priv, int reg)
{
	struct controller *controller = controller_of(priv);
	u8 value = controller->read_reg(priv, reg);

	switch (reg) {
	case SJA1000_IR: /* reading clears it */
		value |= controller->interrupts;
		controller->interrupts = 0;
		break;
	case SJA1000_SR:
		if (controller->errors >= WARNING)
			value |= SR_ES;
		if (controller->errors >= BUS_OFF)
			value |= SR_BS;
		break;
	case SJA1000_TXERR: /* bus-off reads as 127, as in the chip's data sheet */
		value = controller->errors >= BUS_OFF ? 127 : controller->errors;
		break;
	case SJA1000_RXERR:
	case SJA1000_ECC:
		value = 0;
		break;
	}
	return value;
}

static void write_reg(const struct sja1000_priv *priv, int reg, u8 value)
{
	if (reg == SJA1000_TXERR)
		controller_of(priv)->errors = value;
	controller_of(priv)->write_reg(priv, reg, value);
}

/* The interrupts that crossing the chip's limits raises. */
static u8 raised(unsigned int before, unsigned int after)
{
	u8 interrupts = 0;

	if ((before >= WARNING) != (after >= WARNING) || (before >= BUS_OFF) != (after >= BUS_OFF))
		interrupts |= IRQ_EI;
	if ((before >= PASSIVE) != (after >= PASSIVE) && after < BUS_OFF)
		interrupts |= IRQ_EPI;
	return interrupts;
}

static ssize_t transmit_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	char text[32] = {};
	char name[IFNAMSIZ];
	unsigned int errors, i;

	if (size >= sizeof(text))
		return -EINVAL;
	if (copy_from_user(text, from, size))
		return -EFAULT;
	if (sscanf(text, "%15s %u", name, &errors) != 2)
		return -EINVAL;
	for (i = 0; i < CONTROLLERS; i++) {
		struct controller *controller = &controllers[i];

		if (strcmp(controller->dev->name, name))
			continue;
		disable_irq(controller->dev->irq);
		controller->interrupts |= raised(controller->errors, errors);
		controller->errors = errors;
		local_bh_disable();
		sja1000_interrupt(controller->dev->irq, controller->dev);
		local_bh_enable();
		enable_irq(controller->dev->irq);
		return size;
	}
	return -ENODEV;
}

static const struct file_operations transmit_fops = {.owner = THIS_MODULE, .write = transmit_write};

static void release(void)
{
	unsigned int i;

	debugfs_remove(dir);
	for (i = 0; i < CONTROLLERS; i++) {
		struct controller *controller = &controllers[i];
		struct sja1000_priv *priv;

		if (!controller->dev)
			continue;
		priv = netdev_priv(controller->dev);
		priv->read_reg = controller->read_reg;
		priv->write_reg = controller->write_reg;
		dev_put(controller->dev);
	}
}

static int __init errors_init(void)
{
	unsigned int i;

	for (i = 0; i < CONTROLLERS; i++) {
		char name[IFNAMSIZ];
		struct sja1000_priv *priv;

		snprintf(name, sizeof(name), "can%u", i);
		controllers[i].dev = dev_get_by_name(&init_net, name);
		if (!controllers[i].dev) {
			release();
			return -ENODEV;
		}
		priv = netdev_priv(controllers[i].dev);
		controllers[i].read_reg = priv->read_reg;
		controllers[i].write_reg = priv->write_reg;
		priv->read_reg = read_reg;
		priv->write_reg = write_reg;
	}
	dir = debugfs_create_dir("can_errors", NULL);
	debugfs_create_file("transmit", 0200, dir, NULL, &transmit_fops);
	return 0;
}

static void __exit errors_exit(void)
{
	release();
}

module_init(errors_init);
module_exit(errors_exit);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("Bus errors for emulated SJA1000 controllers");
