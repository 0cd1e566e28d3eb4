/* Guard: who is at work when a plugin crashes or never comes back. Every call into a plugin notes the operation, at the
   price of two stores. */
#pragma once
#include <petscsys.h>

typedef struct {
  const char *file, *operation; /* file of the plugin; NULL: not in a plugin */
} GuardCall;

extern volatile GuardCall         SHAPE_GUARD_CALL;
extern volatile unsigned long int SHAPE_GUARD_CALLS;

static inline GuardCall ShapeGuardEnter(const char file[], const char operation[])
{
  const GuardCall before = {SHAPE_GUARD_CALL.file, SHAPE_GUARD_CALL.operation};

  SHAPE_GUARD_CALL.operation = operation;
  SHAPE_GUARD_CALL.file      = file;
  SHAPE_GUARD_CALLS++;
  return before;
}

static inline void ShapeGuardLeave(GuardCall before)
{
  SHAPE_GUARD_CALL.file      = before.file;
  SHAPE_GUARD_CALL.operation = before.operation;
}

/* GUARDED(s, distance, (s, n, x, d)) calls s->ops.distance(s, n, x, d) */
#define GUARDED(s, operation, arguments) \
  do { \
    const GuardCall      before_ = ShapeGuardEnter((s)->loaded->file, #operation); \
    const PetscErrorCode ierr_   = (s)->ops.operation arguments; \
    ShapeGuardLeave(before_); \
    PetscCall(ierr_); \
  } while (0)
