// qemu plugin: how many instructions the emulated program executed and how many cycles a Cortex-A8 needs for
// them, in all, by function, and from tick_begins() to tick_ends() of the program (mean and most), printed
// when it ends. Debian's qemu-user comes without the header; these are the declarations of plugin interface 1
// that are needed.
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef uint64_t qemu_plugin_id_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
struct qemu_info;
enum qemu_plugin_op { QEMU_PLUGIN_INLINE_ADD_U64 };
enum qemu_plugin_cb_flags { QEMU_PLUGIN_CB_NO_REGS };

size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb* block);
struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb* block, size_t index);
char* qemu_plugin_insn_disas(const struct qemu_plugin_insn* instruction);
const char* qemu_plugin_insn_symbol(const struct qemu_plugin_insn* instruction);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                           void (*call)(qemu_plugin_id_t, struct qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb* block, enum qemu_plugin_op op, void* to,
                                              uint64_t add);
void qemu_plugin_register_vcpu_tb_exec_cb(struct qemu_plugin_tb* block, void (*call)(unsigned, void*),
                                          enum qemu_plugin_cb_flags flags, void* data);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, void (*call)(qemu_plugin_id_t, void*), void* data);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

static uint64_t executed;
static uint64_t cycles;

struct function {
  char* name;
  uint64_t cycles;
};
static struct function functions[8192];  // the last takes what finds no room
static size_t known;

static struct function* function_of(const char* name) {
  if (name == NULL || *name == '\0') name = "libraries";
  size_t i = 0;
  while (i < known && strcmp(functions[i].name, name) != 0) ++i;
  if (i == known && known + 1 < sizeof functions / sizeof functions[0])
    functions[known++].name = strdup(name);
  return &functions[i];
}

static uint64_t tick_began, ticks, in_ticks, in_worst_tick;

static void tick_begins(unsigned processor, void* data) {
  (void)processor;
  (void)data;
  tick_began = cycles;
}

static void tick_ends(unsigned processor, void* data) {
  (void)processor;
  (void)data;
  const uint64_t took = cycles - tick_began;
  ++ticks;
  in_ticks += took;
  if (took > in_worst_tick) in_worst_tick = took;
}

// Who computes: VFPLite, which is not pipelined, so that its cycles add up; NEON, which starts an instruction
// a cycle; or neither. Upper ends of the ranges for numbers of normal size in ARM DDI 0344, Cortex-A8
// Technical Reference Manual, Table 16.25, and as GCC (cortex-a8-neon.md) has them; a square root taken like
// a division. 20: what an integer register waits for one of VFP or NEON. VLDR and VSTR: fitted, so that
// Linpack and NBench come out as published for this chip at 1 GHz; taken for every transfer of a register to
// or from memory.
enum { kNeither, kVfp, kNeon };
struct kind {
  const char* begins;
  int unit;
  uint64_t cycles;   // until the next may start
  uint64_t latency;  // until the result may be used, of NEON
};
static const struct kind kKinds[] = {
    {"vadd.f64", kVfp, 10, 0},    {"vsub.f64", kVfp, 10, 0},   {"vmul.f64", kVfp, 17, 0},
    {"vnmul.f64", kVfp, 17, 0},   {"vmla.f64", kVfp, 26, 0},   {"vmls.f64", kVfp, 26, 0},
    {"vnmla.f64", kVfp, 26, 0},   {"vnmls.f64", kVfp, 26, 0},  {"vdiv.f64", kVfp, 65, 0},
    {"vsqrt.f64", kVfp, 65, 0},   {"vcmp", kVfp, 7, 0},        {"vcvt", kVfp, 7, 0},
    {"vabs.f64", kVfp, 4, 0},     {"vneg.f64", kVfp, 4, 0},    {"vadd.f32 s", kVfp, 10, 0},
    {"vsub.f32 s", kVfp, 10, 0},  {"vmul.f32 s", kVfp, 12, 0}, {"vnmul.f32 s", kVfp, 12, 0},
    {"vmla.f32 s", kVfp, 21, 0},  {"vmls.f32 s", kVfp, 21, 0}, {"vdiv.f32 s", kVfp, 37, 0},
    {"vsqrt.f32 s", kVfp, 37, 0}, {"vmrs", kVfp, 20, 0},       {"vldr", kNeon, 4, 1},
    {"vstr", kNeon, 4, 0},        {"vld1", kNeon, 4, 2},       {"vst1", kNeon, 4, 0},
    {"vmla.f32", kNeon, 1, 9},    {"vmls.f32", kNeon, 1, 9},   {"vmul.f32", kNeon, 1, 5},
    {"vadd.f32", kNeon, 1, 5},    {"vsub.f32", kNeon, 1, 5},   {"v", kNeon, 1, 4}};
static const uint64_t kAddsLate = 4;  // cycles after VMLA's start that the sum it adds to is read

static const struct kind* kind_of(const char* text) {
  for (size_t i = 0; i < sizeof kKinds / sizeof kKinds[0]; ++i) {
    if (strncmp(text, kKinds[i].begins, strlen(kKinds[i].begins)) == 0) return &kKinds[i];
  }
  return NULL;
}

// Registers d0 to d31 that a text names, in order; a q is two.
static int registers_of(const char* text, int found[], int most) {
  int count = 0;
  for (const char* at = strchr(text, ' '); at != NULL && *at != '\0' && count + 1 < most; ++at) {
    if ((at[1] != 'd' && at[1] != 'q') || (at[0] != ' ' && at[0] != '{') || at[2] < '0' || at[2] > '9')
      continue;
    const int number = atoi(at + 2);
    if (at[1] == 'q') {
      found[count++] = (2 * number) % 32;
      found[count++] = (2 * number + 1) % 32;
    } else {
      found[count++] = number % 32;
    }
  }
  return count;
}

struct clock {
  uint64_t now;
  uint64_t ready[32];  // of each register of NEON
};

static void pass(struct clock* clock, const char* text) {
  const struct kind* kind = kind_of(text);
  if (kind == NULL) {
    clock->now += 1;  // two may issue at once, and some wait for memory: assumed to cancel
    return;
  }
  int found[16];
  const int count = registers_of(text, found, 16);
  const int wide = strstr(text, " q") != NULL || strchr(text, '{') != NULL;
  const int written =
      kind->latency == 0 ? 0 : (wide && count > 1 && strstr(text, " q") != NULL ? 2 : count > 0);
  uint64_t start = clock->now;
  for (int i = 0; i < count; ++i) {
    const int sum = i < written && kind->latency == 9;
    const uint64_t needed =
        sum ? (clock->ready[found[i]] > kAddsLate ? clock->ready[found[i]] - kAddsLate : 0)
            : (i < written ? 0 : clock->ready[found[i]]);
    if (needed > start) start = needed;
  }
  uint64_t times = 1;
  if (strncmp(text, "vldm", 4) == 0 || strncmp(text, "vstm", 4) == 0 || strncmp(text, "vpush", 5) == 0 ||
      strncmp(text, "vpop", 4) == 0) {
    times = 4 * (uint64_t)(count > 0 ? count : 1);
  } else if (strstr(text, " q") != NULL) {
    times = 2;
  }
  clock->now = start + kind->cycles * times;
  for (int i = 0; i < written; ++i) clock->ready[found[i]] = start + kind->latency + times - 1;
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb* block) {
  (void)id;
  const size_t count = qemu_plugin_tb_n_insns(block);
  struct clock clock = {0};
  for (size_t i = 0; i < count; ++i) {
    char* text = qemu_plugin_insn_disas(qemu_plugin_tb_get_insn(block, i));
    if (text == NULL) {
      clock.now += 1;
    } else {
      for (char* at = text; *at != '\0'; ++at) {
        if (*at == '\t') *at = ' ';
      }
      pass(&clock, text);
    }
    free(text);
  }
  const char* const symbol = qemu_plugin_insn_symbol(qemu_plugin_tb_get_insn(block, 0));
  struct function* const function = function_of(symbol);
  if (strcmp(function->name, "tick_begins") == 0)
    qemu_plugin_register_vcpu_tb_exec_cb(block, tick_begins, QEMU_PLUGIN_CB_NO_REGS, NULL);
  if (strcmp(function->name, "tick_ends") == 0)
    qemu_plugin_register_vcpu_tb_exec_cb(block, tick_ends, QEMU_PLUGIN_CB_NO_REGS, NULL);
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &function->cycles, clock.now);
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &executed, count);
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &cycles, clock.now);
}

static void finished(qemu_plugin_id_t id, void* data) {
  (void)id;
  (void)data;
  fprintf(stderr, "instructions %llu\ncycles %llu\n", (unsigned long long)executed,
          (unsigned long long)cycles);
  if (ticks > 0)
    fprintf(stderr, "tick %llu most %llu\n", (unsigned long long)(in_ticks / ticks),
            (unsigned long long)in_worst_tick);
  for (size_t i = 0; i < known; ++i)
    fprintf(stderr, "function %llu %s\n", (unsigned long long)functions[i].cycles, functions[i].name);
}

__attribute__((visibility("default"))) int qemu_plugin_install(qemu_plugin_id_t id,
                                                               const struct qemu_info* info, int argc,
                                                               char** argv) {
  (void)info;
  (void)argc;
  (void)argv;
  qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
  qemu_plugin_register_atexit_cb(id, finished, NULL);
  return 0;
}
