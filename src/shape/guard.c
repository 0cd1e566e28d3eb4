/* Guard: see guard.h and ShapeGuardInstall in shape/host.h. Handlers call nothing but write, sigaction, raise and
   _exit. */
#include "compat.h"
#include "guard.h"
#include "base/opt.h"
#include "shape/host.h"
#include <signal.h>
#include <string.h>
#include <sys/time.h>
#include <unistd.h>

#define TICK 1 /* s of processor time between two looks */

volatile GuardCall         SHAPE_GUARD_CALL;
volatile unsigned long int SHAPE_GUARD_CALLS;

static const int CRASHES[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
#define NCRASHES ((int)(sizeof(CRASHES) / sizeof(CRASHES[0])))

static struct sigaction usual[NCRASHES];
static int              patience;     /* ticks */
static char             stack[65536]; /* a plugin that calls itself without end has used up its own */

static void say(const char text[])
{
  if (write(STDERR_FILENO, text, strlen(text)) < 0) return; /* nothing left to tell it to */
}

static void blame(const char what[], const char advice[])
{
  say("tumble: error: ");
  say(what);
  say(" operation '");
  say(SHAPE_GUARD_CALL.operation);
  say("' of the shape plugin ");
  say(SHAPE_GUARD_CALL.file);
  say(advice);
  say("; 'make test-shape SHAPE=");
  say(SHAPE_GUARD_CALL.file);
  say("' repeats it alone\n");
  _exit(1);
}

/* Out of a plugin: as if nobody had been here */
static void on_crash(int number)
{
  if (SHAPE_GUARD_CALL.file)
    blame(number == SIGFPE    ? "Arithmetic error in"
          : number == SIGABRT ? "Abort in"
                              : "Crash (memory it does not own) in",
          "");
  for (int i = 0; i < NCRASHES; i++)
    if (CRASHES[i] == number) (void)sigaction(number, &usual[i], NULL);
  (void)raise(number);
}

static void on_tick(int number)
{
  static unsigned long int last;
  static int               same;

  (void)number;
  same = SHAPE_GUARD_CALL.file && SHAPE_GUARD_CALLS == last ? same + 1 : 0;
  last = SHAPE_GUARD_CALLS;
  if (same >= patience) blame("No end of", ", within -shape_patience: correct it, or raise the option");
}

PetscErrorCode ShapeGuardInstall(void)
{
  struct sigaction action;
  stack_t          own     = {.ss_sp = stack, .ss_size = sizeof(stack)};
  PetscReal        seconds = 60;

  PetscFunctionBeginUser;
  PetscCall(OptReal("-shape_patience", &seconds));
  memset(&action, 0, sizeof(action));
  sigemptyset(&action.sa_mask);
  (void)sigaltstack(&own, NULL);
  action.sa_handler = on_crash;
  action.sa_flags   = SA_ONSTACK | SA_NODEFER;
  for (int i = 0; i < NCRASHES; i++) (void)sigaction(CRASHES[i], &action, &usual[i]);
  patience = (int)PetscCeilReal(seconds / TICK);
  if (patience > 0) {
    const struct itimerval every = {{TICK, 0}, {TICK, 0}};

    action.sa_handler = on_tick;
    action.sa_flags   = SA_RESTART | SA_ONSTACK;
    (void)sigaction(SIGVTALRM, &action, NULL);
    (void)setitimer(ITIMER_VIRTUAL, &every, NULL);
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
