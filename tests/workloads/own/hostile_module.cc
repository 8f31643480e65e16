// A module whose kernels do what no kernel should: each costs one cell, and nothing else.
#include <unistd.h>
#ifdef __x86_64__
#include <xmmintrin.h>
#endif

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <pirt/module.hpp>
#include <stdexcept>
#include <thread>

namespace {

using namespace pirt::module;

void copy(const Call& call) {
  const auto input = call.input<uint8_t>(0);
  const auto output = call.output<uint8_t>(0);
  for (int64_t i = 0; i < input.count(); ++i) output[i] = input[i];
}
void crash(const Call&) { std::abort(); }
void hang(const Call& call) {
  while (!call.is_stopped()) ::usleep(1000);
}
/// As one with threads of its own may: they have a copy of the call.
void wait_by_a_copy(const Call& call) {
  struct Job {
    pirt_call call;
    std::uintptr_t behind[4] = {1, 1, 1, 1};
  };
  const Job job{call.raw()};
  std::thread([&job] {
    while (job.call.is_stopped(&job.call) == 0) ::usleep(1000);
  }).join();
}
void write_beyond(const Call& call) {
  copy(call);
  const auto output = call.output<uint8_t>(0);
  output.data()[output.count()] = 7;
}
void write_far_beyond(const Call& call) {
  copy(call);
  const auto output = call.output<uint8_t>(0);
  output.data()[output.count() + 4096] = 7;
}
void throw_something(const Call&) { throw std::runtime_error("no such luck"); }
void throw_a_number(const Call&) { throw 5; }
void ask_for_a_parameter(const Call& call) { static_cast<void>(call.parameter<uint8_t>(0)); }
void ask_for_a_state(const Call& call) { static_cast<void>(call.state<uint8_t>(0)); }
void print(const Call& call) {
  copy(call);
  std::puts("hello\npirt-record {}\npirt-progress all is well");
  std::fflush(stdout);
  // So long that the clock can tell, however slow the first call was.
  const auto begin = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - begin < std::chrono::microseconds(200)) {
  }
}
void end(const Call&) { std::exit(0); }
void leave_a_thread(const Call& call) {
  copy(call);
  std::thread([] {
    for (;;) ::sleep(1000);
  }).detach();
}
void be_wrong(const Call& call) {
  copy(call);
  call.output<uint8_t>(0)[5] ^= 1;
}
void write_half(const Call& call) {
  const auto input = call.input<uint8_t>(0);
  const auto output = call.output<uint8_t>(0);
  for (int64_t i = 0; i < input.count(); i += 2) output[i] = input[i];
}
#ifdef __x86_64__
/// As -ffast-math has it done: denormals are 0.
__attribute__((constructor)) void flush_denormals() { _mm_setcsr(_mm_getcsr() | 0x8040); }
#endif
/// Adds the input to what it keeps, and gives the sum.
void add_up(const Call& call) {
  const auto input = call.input<int32_t>(0);
  const auto sum = call.state<int32_t>(0);
  const auto next = call.next_state<int32_t>(0);
  const auto output = call.output<int32_t>(0);
  for (int64_t i = 0; i < input.count(); ++i) output[i] = next[i] = sum[i] + input[i];
}
/// The positions of pixels above 127.
void list_bright(const Call& call) {
  const auto input = call.input<uint8_t>(0);
  const auto output = call.output<int32_t>(0);
  int64_t rows = 0;
  for (int64_t i = 0; i < input.count(); ++i) {
    if (input[i] > 127) output[rows++] = static_cast<int32_t>(i);
  }
  call.set_rows(0, rows);
}
void list_too_many(const Call& call) { call.set_rows(0, 1 << 20); }

Workload copies(const char* name) {
  return Workload(std::string("bad.") + name)
      .input<uint8_t>("from", {101})
      .output<uint8_t>("to", {101});
}
int make_nine(uint64_t, int32_t, pirt_tensor* inputs, pirt_tensor*) {
  static_cast<uint8_t*>(inputs[0].data)[0] = 9;
  return 0;
}
/// It says that its input is 0 or 1.
Workload out_of_range() {
  Workload made = copies("outside");
  auto& input = const_cast<pirt_tensor_spec&>(*made.raw().inputs);
  input.has_range = 1, input.low = 0, input.high = 1;
  made.raw().make_inputs = make_nine;
  return made;
}
Workload lists(const char* name) {
  Workload made = Workload(std::string("bad.") + name).input<uint8_t>("image", {kHeight, kWidth});
  made.output<int32_t>("bright", {4096}).size(64, 64);
  const_cast<pirt_tensor_spec*>(made.raw().outputs)->varies = 1;
  return made;
}

}  // namespace

PIRT_MODULE(copies("good").cpu<copy>().reference<copy>(), copies("crash").cpu<crash>(),
            copies("hang").cpu<hang>(), copies("waits_by_a_copy").cpu<wait_by_a_copy>(),
            copies("beyond").cpu<write_beyond>(), copies("far_beyond").cpu<write_far_beyond>(),
            copies("throws").cpu<throw_something>(), copies("throws_5").cpu<throw_a_number>(),
            copies("asks_parameter").cpu<ask_for_a_parameter>(),
            copies("asks_state").cpu<ask_for_a_state>(),
            copies("prints").cpu<print>().reference<copy>(), copies("ends").cpu<end>(),
            copies("thread").cpu<leave_a_thread>(),
            copies("wrong").cpu<be_wrong>().reference<copy>(), copies("half").cpu<write_half>(),
            copies("slices").cpu<copy>().slices(4), out_of_range().cpu<copy>(),
            Workload("bad.renamed")
                .input<uint8_t>("origin", {101})
                .output<uint8_t>("to", {101})
                .cpu<copy>(),
            Workload("bad.sum")
                .input<int32_t>("more", {16})
                .output<int32_t>("all", {16})
                .state<int32_t>("sum", {16})
                .frames(4)
                .cpu<add_up>()
                .reference<add_up>(),
            lists("list").cpu<list_bright>().reference<list_bright>(),
            lists("too_many").cpu<list_too_many>())
