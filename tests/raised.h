/* Errors that a test provokes: begin_error(), the call, expect_error(what it returned, ...). */
#pragma once
#include "compat.h"
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <cmocka.h>

static char raised[2100]; /* message of the last error */
static int  raised_times; /* how often an error was raised (not passed on) since begin_error() */

static inline PetscErrorCode record_error(MPI_Comm comm, int line, const char *fun, const char *file, PetscErrorCode n,
                                          PetscErrorType p, const char *mess, void *ctx)
{
  (void)comm, (void)line, (void)fun, (void)file, (void)ctx;
  if (p == PETSC_ERROR_INITIAL) {
    raised_times++;
    snprintf(raised, sizeof(raised), "%s", mess ? mess : "");
  }
  return n;
}

static inline void begin_error(void)
{
  raised[0]    = 0;
  raised_times = 0;
  assert_int_equal(PetscPushErrorHandler(record_error, NULL), 0);
}

static inline void end_error(void)
{
  assert_int_equal(PetscPopErrorHandler(), 0);
}

/* The call since begin_error() must have raised `code` (0: any error) once with all of the given texts (the last is
   NULL) in its message. */
static inline void expect_error(PetscErrorCode got, PetscErrorCode code, ...)
{
  va_list     texts;
  const char *text;

  end_error();
  if (code) assert_int_equal(got, code);
  else assert_int_not_equal(got, 0);
  assert_int_equal(raised_times, 1);
  va_start(texts, code);
  while ((text = va_arg(texts, const char *))) {
    if (!strstr(raised, text)) fail_msg("'%s' is not in the message '%s'", text, raised);
  }
  va_end(texts);
}
