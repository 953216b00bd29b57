#include "board.h"

#include <stddef.h>

// --- Addresses of the linker script, and the start.

extern uint32_t stack_bottom[], stack_top[], data_load[], data_start[], data_end[], bss_start[], bss_end[];
int main(void);
void reset(void);

static const uint32_t paint = 0x5eed5eed;

// Semihosting: the debugger, here QEMU, does what the program asks for.
static void ask(int operation, const void* argument) {
  register int what __asm__("r0") = operation;
  register const void* with __asm__("r1") = argument;
  __asm__ volatile("bkpt 0xab" : "+r"(what) : "r"(with) : "memory");
}

static void end(int status) {
  enum { exit_extended = 0x20, application_exit = 0x20026 };
  const uint32_t block[] = {application_exit, (uint32_t)status};
  ask(exit_extended, block);
  for (;;) continue;
}

static volatile uint32_t* const systick = (volatile uint32_t*)0xe000e010;

void reset(void) {
  volatile uint32_t* const coprocessor_access = (volatile uint32_t*)0xe000ed88;
  *coprocessor_access |= 0xfU << 20;  // the floating-point unit
  __asm__ volatile("dsb\n isb");
  uint32_t* here;
  __asm__("mov %0, sp" : "=r"(here));
  for (uint32_t* word = stack_bottom; word < here; ++word) *word = paint;
  for (uint32_t *to = data_start, *from = data_load; to < data_end; ++to, ++from) *to = *from;
  for (uint32_t* to = bss_start; to < bss_end; ++to) *to = 0;
  systick[1] = 0xffffff;  // counts down from here
  systick[2] = 0;
  systick[0] = 5;  // on, by the processor's clock
  end(main());
}

static void fault(void) {
  end(2);
}

// What the processor begins with, and where it goes on when something is wrong.
static const struct {
  uint32_t* stack;
  void (*handlers[6])(void);
} vectors __attribute__((section(".vectors"), used)) = {stack_top, {reset, fault, fault, fault, fault, fault}};

// ---

void board_print(const char* words, const float* numbers, int count) {
  enum { write0 = 0x04, places = 4 };
  ask(write0, words);
  for (int k = 0; k < count; ++k) {
    const float size = numbers[k] < 0 ? -numbers[k] : numbers[k];
    uint32_t whole = (uint32_t)(size * 1e4F + 0.5F);
    char text[16] = {0};
    char* at = text + sizeof text - 1;
    for (int digit = 0; digit <= places || whole != 0; ++digit) {
      if (digit == places) *--at = '.';
      *--at = (char)('0' + whole % 10);
      whole /= 10;
    }
    if (numbers[k] < 0) *--at = '-';
    *--at = ' ';
    ask(write0, at);
  }
  ask(write0, "\n");
}

uint32_t board_ticks(void) {
  return 0xffffff - systick[2];
}

uint32_t board_stack_used(void) {
  const uint32_t* word = stack_bottom;
  while (word < stack_top && *word == paint) ++word;
  return (uint32_t)(stack_top - word) * sizeof *word;
}
