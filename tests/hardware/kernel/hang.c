// SPDX-License-Identifier: GPL-2.0
/* A kernel that hangs: no interrupt is ever served again. Loaded, it says on the console's own registers how
 * many seconds have passed since, for whoever waits for the watchdog's reset. */
#include <linux/io.h>
#include <linux/irqflags.h>
#include <linux/ktime.h>
#include <linux/module.h>
#include <linux/timekeeping.h>

#define PL011_OF_QEMU_VIRT 0x09000000

static int __init hang_init(void)
{
	void __iomem *uart = ioremap(PL011_OF_QEMU_VIRT, 0x1000);
	u64 start, said = 0, now;
	char text[20];
	int i, n;

	if (!uart)
		return -ENOMEM;
	local_irq_disable();
	start = ktime_get_mono_fast_ns();
	for (;;) {
		now = div_u64(ktime_get_mono_fast_ns() - start, NSEC_PER_SEC);
		if (now == said)
			continue;
		said = now;
		n = scnprintf(text, sizeof(text), "HUNG %llu\r\n", said);
		for (i = 0; i < n; i++)
			writel(text[i], uart);
	}
}

module_init(hang_init);
MODULE_LICENSE("GPL");
MODULE_DESCRIPTION("hangs the kernel");
