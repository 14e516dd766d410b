// SPDX-License-Identifier: GPL-2.0
/* Three eQEP decoders with the interface of ti-eqep: the ceiling resets to 0, the count wraps at ceiling + 1.
 */
#include <linux/counter.h>
#include <linux/fs.h>
#include <linux/module.h>
#include <linux/platform_device.h>
#include <linux/uaccess.h>

#include "bench.h"

enum { DECODERS = 3 };

struct bench_decoder {
	const char *name;
	char device_name[24];
	struct platform_device *device;
	struct counter_device *counter;
	u64 ceiling;
	u8 enabled;
	enum counter_function function;
};

static struct bench_decoder decoders[DECODERS] = {
    {.name = "48300180"}, {.name = "48302180"}, {.name = "48304180"}};
static s64 positions[DECODERS]; /* where the wheels are, in counts */
static u8 stuck;		/* bit n: decoder n keeps its count */
static struct bench_fault fault;

static struct bench_decoder *decoder_of(struct counter_device *counter)
{
	return *(struct bench_decoder **)counter_priv(counter);
}

static int count_read(struct counter_device *counter, struct counter_count *count, u64 *value)
{
	struct bench_decoder *decoder = decoder_of(counter);
	int err;

	mutex_lock(&bench_lock);
	err = bench_take_fault(&fault);
	/* The ceiling is 2^n - 1 here, so the modulo is a mask: 32-bit ARM has no 64-bit division. */
	*value = decoder->enabled ? (u64)positions[decoder - decoders] & decoder->ceiling : 0;
	mutex_unlock(&bench_lock);
	return err;
}

static int function_read(struct counter_device *counter, struct counter_count *count,
			 enum counter_function *function)
{
	*function = decoder_of(counter)->function;
	return 0;
}

static int function_write(struct counter_device *counter, struct counter_count *count,
			  enum counter_function function)
{
	decoder_of(counter)->function = function;
	return 0;
}

static int action_read(struct counter_device *counter, struct counter_count *count,
		       struct counter_synapse *synapse, enum counter_synapse_action *action)
{
	*action = COUNTER_SYNAPSE_ACTION_BOTH_EDGES;
	return 0;
}

static int ceiling_read(struct counter_device *counter, struct counter_count *count, u64 *ceiling)
{
	*ceiling = decoder_of(counter)->ceiling;
	return 0;
}

static int ceiling_write(struct counter_device *counter, struct counter_count *count, u64 ceiling)
{
	if (ceiling > U32_MAX || (ceiling & (ceiling + 1)))
		return -ERANGE;
	decoder_of(counter)->ceiling = ceiling;
	return 0;
}

static int enable_read(struct counter_device *counter, struct counter_count *count, u8 *enabled)
{
	*enabled = decoder_of(counter)->enabled;
	return 0;
}

static int enable_write(struct counter_device *counter, struct counter_count *count, u8 enabled)
{
	decoder_of(counter)->enabled = enabled;
	return 0;
}

static const struct counter_ops ops = {.count_read = count_read,
				       .function_read = function_read,
				       .function_write = function_write,
				       .action_read = action_read};
static struct counter_comp extensions[] = {COUNTER_COMP_CEILING(ceiling_read, ceiling_write),
					   COUNTER_COMP_ENABLE(enable_read, enable_write)};
static const enum counter_function functions[] = {COUNTER_FUNCTION_PULSE_DIRECTION,
						  COUNTER_FUNCTION_QUADRATURE_X4, COUNTER_FUNCTION_INCREASE,
						  COUNTER_FUNCTION_DECREASE};
static const enum counter_synapse_action actions[] = {COUNTER_SYNAPSE_ACTION_BOTH_EDGES};
static struct counter_signal signals[] = {{.id = 0, .name = "QEPA"}, {.id = 1, .name = "QEPB"}};
static struct counter_synapse synapses[] = {{actions, 1, &signals[0]}, {actions, 1, &signals[1]}};
static struct counter_count counts[] = {{.id = 0,
					 .name = "QPOSCNT",
					 .functions_list = functions,
					 .num_functions = ARRAY_SIZE(functions),
					 .synapses = synapses,
					 .num_synapses = ARRAY_SIZE(synapses),
					 .ext = extensions,
					 .num_ext = ARRAY_SIZE(extensions)}};

static int plug(struct bench_decoder *decoder)
{
	struct counter_device *counter;
	int err;

	snprintf(decoder->device_name, sizeof(decoder->device_name), "%s.counter", decoder->name);
	decoder->device = platform_device_register_simple(decoder->device_name, PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(decoder->device)) {
		err = PTR_ERR(decoder->device);
		decoder->device = NULL;
		return err;
	}
	counter = counter_alloc(sizeof(struct bench_decoder *));
	if (!counter) {
		err = -ENOMEM;
		goto no_counter;
	}
	*(struct bench_decoder **)counter_priv(counter) = decoder;
	counter->name = decoder->device_name;
	counter->parent = &decoder->device->dev;
	counter->ops = &ops;
	counter->signals = signals;
	counter->num_signals = ARRAY_SIZE(signals);
	counter->counts = counts;
	counter->num_counts = ARRAY_SIZE(counts);
	err = counter_add(counter);
	if (err) {
		counter_put(counter);
		goto no_counter;
	}
	decoder->counter = counter;
	decoder->ceiling = 0;
	decoder->enabled = 0;
	return 0;
no_counter:
	platform_device_unregister(decoder->device);
	decoder->device = NULL;
	return err;
}

static void unplug(struct bench_decoder *decoder)
{
	if (!decoder->device)
		return;
	counter_unregister(decoder->counter);
	counter_put(decoder->counter);
	platform_device_unregister(decoder->device);
	decoder->device = NULL;
}

/* -ENODEV: not one of ours. */
int bench_counter_plug(const char *name, bool in)
{
	int i;

	for (i = 0; i < DECODERS; i++) {
		if (strcmp(decoders[i].name, name))
			continue;
		if (!in)
			unplug(&decoders[i]);
		else if (!decoders[i].device)
			return plug(&decoders[i]);
		return 0;
	}
	return -ENODEV;
}

/* Three s64, the machine's byte order. */
static ssize_t positions_write(struct file *file, const char __user *from, size_t size, loff_t *at)
{
	s64 values[DECODERS];
	int i;

	if (size != sizeof(values))
		return -EINVAL;
	if (copy_from_user(values, from, sizeof(values)))
		return -EFAULT;
	mutex_lock(&bench_lock);
	for (i = 0; i < DECODERS; i++) {
		if (!(stuck & BIT(i)))
			positions[i] = values[i];
	}
	mutex_unlock(&bench_lock);
	return size;
}

static const struct file_operations positions_fops = {.owner = THIS_MODULE, .write = positions_write};

int bench_counter_init(struct dentry *dir)
{
	int i, err = 0;

	debugfs_create_file("counter_positions", 0200, dir, NULL, &positions_fops);
	debugfs_create_u8("counter_stuck", 0644, dir, &stuck);
	bench_fault_files("counter", dir, &fault);
	for (i = 0; !err && i < DECODERS; i++)
		err = plug(&decoders[i]);
	if (err)
		bench_counter_exit();
	return err;
}

void bench_counter_exit(void)
{
	int i;

	for (i = 0; i < DECODERS; i++)
		unplug(&decoders[i]);
}

MODULE_IMPORT_NS(COUNTER);
