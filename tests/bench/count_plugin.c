// qemu plugin: how many instructions the emulated program executed and how many cycles a Cortex-A8 needs for
// them, printed when it ends. Debian's qemu-user comes without the header; these are the declarations
// of plugin interface 1 that are needed.
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

size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb* block);
struct qemu_plugin_insn* qemu_plugin_tb_get_insn(const struct qemu_plugin_tb* block, size_t index);
char* qemu_plugin_insn_disas(const struct qemu_plugin_insn* instruction);
void qemu_plugin_register_vcpu_tb_trans_cb(qemu_plugin_id_t id,
                                           void (*call)(qemu_plugin_id_t, struct qemu_plugin_tb*));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb* block, enum qemu_plugin_op op, void* to,
                                              uint64_t add);
void qemu_plugin_register_atexit_cb(qemu_plugin_id_t id, void (*call)(qemu_plugin_id_t, void*), void* data);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;

static uint64_t executed;
static uint64_t cycles;

// VFPLite is not pipelined, so that its cycles add up. Upper ends of the ranges for doubles of normal size in
// ARM DDI 0344, Cortex-A8 Technical Reference Manual, Table 16.25; a square root taken like a division. The
// last two are our assumptions: other VFP arithmetic like a multiplication, 20 for a flag that the integer
// side waits for.
static const struct {
  const char* begins;
  uint64_t cycles;
} kVfp[] = {{"vadd.f64", 10}, {"vsub.f64", 10},  {"vmul.f64", 17},  {"vnmul.f64", 17}, {"vmla.f64", 26},
            {"vmls.f64", 26}, {"vnmla.f64", 26}, {"vnmls.f64", 26}, {"vdiv.f64", 65},  {"vsqrt.f64", 65},
            {"vcmp", 17},     {"vcvt", 17},      {"vabs.f64", 17},  {"vneg.f64", 17},  {"vmrs", 20}};

// Everything else one cycle, our assumption: two may issue at once, and some wait for memory.
static uint64_t cycles_of(const char* text) {
  for (size_t i = 0; i < sizeof kVfp / sizeof kVfp[0]; ++i) {
    if (strncmp(text, kVfp[i].begins, strlen(kVfp[i].begins)) == 0) return kVfp[i].cycles;
  }
  return 1;
}

static void translated(qemu_plugin_id_t id, struct qemu_plugin_tb* block) {
  (void)id;
  const size_t count = qemu_plugin_tb_n_insns(block);
  uint64_t needed = 0;
  for (size_t i = 0; i < count; ++i) {
    char* text = qemu_plugin_insn_disas(qemu_plugin_tb_get_insn(block, i));
    needed += text == NULL ? 1 : cycles_of(text);
    free(text);
  }
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &executed, count);
  qemu_plugin_register_vcpu_tb_exec_inline(block, QEMU_PLUGIN_INLINE_ADD_U64, &cycles, needed);
}

static void finished(qemu_plugin_id_t id, void* data) {
  (void)id;
  (void)data;
  fprintf(stderr, "instructions %llu\ncycles %llu\n", (unsigned long long)executed,
          (unsigned long long)cycles);
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
