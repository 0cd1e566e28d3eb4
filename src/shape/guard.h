/* Guard: who is at work when a plugin crashes or never comes back. Every call into a plugin notes the operation, at the
   price of two stores. */
#pragma once
#include <petscsys.h>

typedef struct {
  const char *file, *operation; /* file of the plugin; NULL: not in a plugin */
} GuardPlace;

extern volatile GuardPlace        SHAPE_GUARD_PLACE;
extern volatile unsigned long int SHAPE_GUARD_CALLS;

static inline GuardPlace ShapeGuardEnter(const char file[], const char operation[])
{
  const GuardPlace before = {SHAPE_GUARD_PLACE.file, SHAPE_GUARD_PLACE.operation};

  SHAPE_GUARD_PLACE.operation = operation;
  SHAPE_GUARD_PLACE.file      = file;
  SHAPE_GUARD_CALLS++;
  return before;
}

static inline void ShapeGuardLeave(GuardPlace before)
{
  SHAPE_GUARD_PLACE.file      = before.file;
  SHAPE_GUARD_PLACE.operation = before.operation;
}

/* GUARDED(s, distance, (s, n, x, d)) calls s->ops.distance(s, n, x, d) */
#define GUARDED(s, operation, arguments) \
  do { \
    const GuardPlace     before_ = ShapeGuardEnter((s)->loaded->file, #operation); \
    const PetscErrorCode ierr_   = (s)->ops.operation arguments; \
    ShapeGuardLeave(before_); \
    PetscCall(ierr_); \
  } while (0)
