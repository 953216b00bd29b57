// What the program asks of the board: here one that QEMU emulates, mps2-an386.
#ifndef BOARD_H
#define BOARD_H

#include <stdint.h>

// Of the clock, while QEMU counts an instruction as a nanosecond (-icount shift=0) and the clock has 25 MHz.
#define board_instructions_a_tick 40

// Prints words, and numbers up to 400,000 with four digits after the point: printf would take more room than the
// pendulum.
void board_print(const char* words, const float* numbers, int count);

// Counts up, wraps after 24 bits: 0.67 s.
uint32_t board_ticks(void);

// Bytes of the stack that were in use at most.
uint32_t board_stack_used(void);

#endif
