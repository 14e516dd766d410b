// SPDX-License-Identifier: GPL-2.0
/* LSM6DSO at address 0x6a of /dev/i2c-2, as far as st_lsm6dsx uses it: registers and the sensor hub's page,
 * reset, timestamp, tagged FIFO with its threshold. From DS12140 and AN5192; that a slot begins with its
 * timestamp is what that driver takes for granted. */
#include <linux/i2c.h>
#include <linux/ktime.h>
#include <linux/string.h>

#include "bench.h"

enum { WORDS = 512, WORD_BYTES = 7, TICK_NS = 25000 };
enum {
	FUNC_CFG_ACCESS = 0x01,
	FIFO_CTRL1 = 0x07,
	FIFO_CTRL2 = 0x08,
	FIFO_CTRL3 = 0x09,
	FIFO_CTRL4 = 0x0a,
	INT1_CTRL = 0x0d,
	WHO_AM_I = 0x0f,
	CTRL3_C = 0x12,
	FIFO_STATUS1 = 0x3a,
	FIFO_STATUS2 = 0x3b,
	TIMESTAMP2 = 0x42,
	FIFO_DATA_OUT_TAG = 0x78,
	FIFO_DATA_OUT_Z_H = 0x7e
};
enum { TAG_GYRO = 1, TAG_ACCEL = 2, TAG_TIME = 4 };

static u8 reg[128], hub[128], pointer;
static u8 fifo[WORDS][WORD_BYTES];
static unsigned int head, words;
static u64 zero_ns; /* when the timestamp was 0 */

static u8 *cell(u8 at)
{
	return at != FUNC_CFG_ACCESS && reg[FUNC_CFG_ACCESS] & 0x40 ? &hub[at] : &reg[at];
}

static void store(u8 at, u8 value)
{
	*cell(at) = value;
	if (at == CTRL3_C) {
		if (value & 0x01)
			memset(reg, 0, sizeof(reg));
		reg[CTRL3_C] &= ~0x81; /* reset and boot clear themselves */
	}
	if (at == TIMESTAMP2 && value == 0xaa)
		zero_ns = ktime_get_ns();
	if (!(reg[FIFO_CTRL4] & 0x07))
		words = 0;
}

static u8 load(u8 at)
{
	u8 value;

	switch (at) {
	case WHO_AM_I:
		return 0x6c;
	case FIFO_STATUS1:
		return words & 0xff;
	case FIFO_STATUS2:
		return words >> 8;
	}
	if (at < FIFO_DATA_OUT_TAG || !words)
		return *cell(at);
	value = fifo[head][at - FIFO_DATA_OUT_TAG];
	if (at == FIFO_DATA_OUT_Z_H) {
		head = (head + 1) % WORDS;
		words--;
	}
	return value;
}

void bench_lsm6dso_message(struct i2c_msg *message)
{
	int i = 0;

	if (!(message->flags & I2C_M_RD) && message->len)
		pointer = message->buf[i++] & 0x7f;
	for (; i < message->len; i++) {
		if (message->flags & I2C_M_RD)
			message->buf[i] = load(pointer);
		else
			store(pointer, message->buf[i]);
		pointer = pointer == FIFO_DATA_OUT_Z_H ? FIFO_DATA_OUT_TAG : (pointer + 1) & 0x7f;
	}
}

static void push(u8 tag, const u8 *bytes)
{
	u8 *word = fifo[(head + words) % WORDS];

	if (words == WORDS)
		return;
	word[0] = tag << 3;
	memcpy(word + 1, bytes, WORD_BYTES - 1);
	words++;
}

/* Three axes of the bench's big-endian counts in the chip's, numerator / denominator of them each. */
static void push_axes(u8 tag, const u8 *counts, s32 numerator, s32 denominator)
{
	u8 axes[6];
	int i;

	for (i = 0; i < 3; i++) {
		s32 value = (s16)(counts[2 * i] << 8 | counts[2 * i + 1]) * numerator / denominator;

		value = clamp(value, -32768, 32767);
		axes[2 * i] = value & 0xff;
		axes[2 * i + 1] = value >> 8;
	}
	push(tag, axes);
}

/* A conversion at 8 g and 2000 deg/s has ended; true: the threshold is reached, INT1 rises. */
bool bench_lsm6dso_convert(const u8 *sample)
{
	u32 ticks = div_u64(ktime_get_ns() - zero_ns, TICK_NS);
	u8 time[6] = {ticks, ticks >> 8, ticks >> 16, ticks >> 24};

	if ((reg[FIFO_CTRL4] & 0x07) != 0x06)
		return false;
	if (reg[FIFO_CTRL4] & 0xc0)
		push(TAG_TIME, time);
	if (reg[FIFO_CTRL3] & 0xf0) /* 70 mdeg/s for the bench's 1 / 16.4 */
		push_axes(TAG_GYRO, sample + 8, 1000, 1148);
	if (reg[FIFO_CTRL3] & 0x0f) /* 0.244 mg for the bench's 1 / 4096 */
		push_axes(TAG_ACCEL, sample, 15625, 15616);
	return reg[INT1_CTRL] & 0x08 && words >= (reg[FIFO_CTRL1] | (reg[FIFO_CTRL2] & 1) << 8);
}
