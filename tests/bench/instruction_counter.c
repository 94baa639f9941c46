/* Plugin of qemu-user 7.2: instructions up to each mark of tests/bench/instructions.py, and up to the end.
 *
 *   gcc -O2 -shared -fPIC -o counter.so tests/bench/instruction_counter.c
 *   qemu-aarch64 -cpu cortex-a76 -plugin ./counter.so PROGRAM ...      for x86-64: gcc -DGETPRIORITY=140
 *
 * Counts every instruction of every thread of one process. The declarations are those of qemu-plugin.h,
 * version 1, which Debian does not package.
 */
#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>

#ifndef GETPRIORITY
#define GETPRIORITY 141 /* of the guest: aarch64 */
#endif
#define MARK 77
#define THREADS 256

typedef uint64_t plugin_id;
struct qemu_plugin_tb;
extern void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct qemu_plugin_tb *));
extern void qemu_plugin_register_vcpu_tb_exec_cb(
    struct qemu_plugin_tb *, void (*)(unsigned, void *), int flags, void *);
extern void qemu_plugin_register_vcpu_syscall_cb(plugin_id,
    void (*)(plugin_id, unsigned, int64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t, uint64_t,
        uint64_t, uint64_t));
extern void qemu_plugin_register_atexit_cb(plugin_id, void (*)(plugin_id, void *), void *);
extern size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);

int qemu_plugin_version = 1;
static struct { uint64_t instructions, rest_of_line[7]; } of_thread[THREADS];

static void executed(unsigned thread, void *instructions) {
    of_thread[thread % THREADS].instructions += (uintptr_t)instructions;
}

static void translated(plugin_id id, struct qemu_plugin_tb *block) {
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_cb(
        block, executed, 0, (void *)(uintptr_t)qemu_plugin_tb_n_insns(block));
}

static void say(const char *what, uint64_t number) {
    uint64_t sum = 0;
    for (int k = 0; k < THREADS; k++) sum += of_thread[k].instructions;
    fprintf(stderr, "%s %" PRIu64 ": %" PRIu64 " instructions\n", what, number, sum);
}

static void called(plugin_id id, unsigned thread, int64_t call, uint64_t which, uint64_t number, uint64_t c,
    uint64_t d, uint64_t e, uint64_t f, uint64_t g, uint64_t h) {
    (void)id, (void)thread, (void)c, (void)d, (void)e, (void)f, (void)g, (void)h;
    if (call == GETPRIORITY && (uint32_t)which == MARK) say("mark", number);
}

static void ended(plugin_id id, void *nothing) {
    (void)id, (void)nothing;
    say("end", 0);
}

int qemu_plugin_install(plugin_id id, const void *info, int count, char **arguments) {
    (void)info, (void)count, (void)arguments;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_vcpu_syscall_cb(id, called);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
