/* The source of module_v1_x86_64.so, a module of version 1 that every later pirt loads:
 *   gcc -std=c99 -O2 -shared -fPIC -nostdlib -s -Wl,--build-id=none -I build/include module_v1.c -o module_v1_x86_64.so
 * The tests load the binary of then, which is what they are about; tests/examples/module_c builds the source, too. */
#include <pirt/module.h>

static int add(void *kernel, const pirt_call *call) {
  const int32_t *a = call->inputs[0].data, *b = call->inputs[1].data;
  int32_t *sum = call->outputs[0].data;
  (void)kernel;
  for (int i = 0; i < 64; ++i) sum[i] = a[i] + b[i];
  return 0;
}
static int reference(const pirt_call *call) { return add(0, call); }

#define TENSOR(name) {PIRT_HEAD(pirt_tensor_spec), name, PIRT_I32, 1, {64}, 0, 0, 0, 0}
static const pirt_tensor_spec inputs[] = {TENSOR("a"), TENSOR("b")}, outputs[] = {TENSOR("sum")};
static const pirt_cpu_kernel cpu = {PIRT_HEAD(pirt_cpu_kernel), 0, add, 0};
static const pirt_workload workload = {
    PIRT_HEAD(pirt_workload), "v1.add", "the sum of two vectors", inputs, outputs, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, reference,
    &cpu, 0};
static const pirt_workload *const workloads[] = {&workload};
static const pirt_module module = {PIRT_HEAD(pirt_module), workloads, 1};
const pirt_module *pirt_module_v1(void) { return &module; }
