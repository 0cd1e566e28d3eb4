/* Mix: random-looking integers, the same on every machine. */
#pragma once
#include <petscsys.h>
#include <stdint.h>

/* The step of splitmix64's state, and its finalizer (Steele, Lea & Flood, OOPSLA 2014) */
#define MIX_STEP 0x9e3779b97f4a7c15u

static inline uint64_t Mix64(uint64_t z)
{
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}
