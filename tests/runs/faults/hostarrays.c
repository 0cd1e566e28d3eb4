/* Preloaded: which entries of PETSc's vectors the program asks for on the host (VecGetArray, ...Read, ...Write). On a
   device each of these brings a vector over the bus. At the end a line for every place that asked: calls, bytes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <petscvec.h>
#include <stdio.h>
#include <string.h>

#define MOST 256

static struct {
  const char *who;
  long        calls;
  double      bytes;
} list[MOST];

static void count(Vec v, const void *caller)
{
  Dl_info  info;
  PetscInt n, k = 0;

  if (!dladdr(caller, &info) || !info.dli_fname || !strstr(info.dli_fname, "libtumble")) return;
  VecGetLocalSize(v, &n);
  if (!info.dli_sname) info.dli_sname = "?";
  while (k < MOST - 1 && list[k].who && strcmp(list[k].who, info.dli_sname) != 0) k++;
  list[k].who = info.dli_sname;
  list[k].calls++;
  list[k].bytes += 8. * (double)n;
}

#define COUNTED(name, type) \
  PetscErrorCode name(Vec v, type a) \
  { \
    PetscErrorCode (*next)(Vec, type) = (PetscErrorCode(*)(Vec, type))dlsym(RTLD_NEXT, #name); \
\
    count(v, __builtin_return_address(0)); \
    return (*next)(v, a); \
  }

COUNTED(VecGetArray, PetscScalar **)
COUNTED(VecGetArrayWrite, PetscScalar **)
COUNTED(VecGetArrayRead, const PetscScalar **)

__attribute__((destructor)) static void tell(void)
{
  for (PetscInt k = 0; k < MOST && list[k].who; k++)
    fprintf(stderr, "host array: %s %ld %.0f\n", list[k].who, list[k].calls, list[k].bytes);
}
