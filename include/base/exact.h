/* Exact: sums of reals without rounding, so that neither their order nor the number of ranks shows (Kulisch's long
   accumulator). */
#pragma once
#include <petscsys.h>
#include <stdint.h>
#include <string.h>

#define EXACT_WORDS 70

/* Fixed point with digits of 32 bits from 2^-1074 upwards, each with room for carries; zero it before use: = {0} */
typedef struct {
  PetscInt64 digit[EXACT_WORDS];
  PetscInt64 added; /* since the last carry */
  PetscInt64 bad;   /* terms that were no numbers: the sum is none */
} Exact;

/* Digits in [0, 2^32) again but for the highest, which has the sign */
void ExactCarry(Exact *);
/* A real is an integer of 53 bits times a power of two: it falls into three digits */
static inline void ExactAdd(Exact *e, PetscReal term)
{
  uint64_t    bits, m, low, high;
  unsigned    exponent;
  PetscInt64 *digit;

  memcpy(&bits, &term, sizeof(bits));
  exponent = bits >> 52 & 0x7ff;
  if (exponent == 0x7ff) {
    e->bad++;
    return;
  }
  m        = (bits & 0xfffffffffffff) | (uint64_t)(exponent > 0) << 52;
  exponent = exponent > 0 ? exponent - 1 : 0;
  digit    = e->digit + exponent / 32;
  low      = (m & 0xffffffff) << exponent % 32;
  high     = (m >> 32) << exponent % 32;
  m        = bits >> 63 ? -(uint64_t)1 : 1;
  digit[0] += (PetscInt64)(m * (low & 0xffffffff));
  digit[1] += (PetscInt64)(m * ((low >> 32) + (high & 0xffffffff)));
  digit[2] += (PetscInt64)(m * (high >> 32));
  if (++e->added == (PetscInt64)1 << 28) ExactCarry(e); /* long before digits overflow */
}
/* Correct to the last bit but one. Exact on all ranks: the sum over them. Collective on comm. */
PetscErrorCode ExactGetSum(MPI_Comm comm, Exact *, PetscReal *sum);
