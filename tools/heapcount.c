/* heapcount: live bytes of the heap while a program runs; to be put before it (LD_PRELOAD, GNU C library).

   At exit of every rank one line goes to the file HEAPCOUNT names:
     live peak
   live: bytes of blocks in use when the last step of the flow began (FlowBeginStep), between two steps; peak: the most
   of them at any time. Sizes as malloc_usable_size has them. Without HEAPCOUNT nothing is written. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
extern void  __libc_free(void *);

static atomic_long live, peak, step;

static void *add(void *p)
{
  if (p) {
    const long now = atomic_fetch_add(&live, (long)malloc_usable_size(p)) + (long)malloc_usable_size(p);

    if (now > peak) peak = now;
  }
  return p;
}

static void take(void *p)
{
  if (p) atomic_fetch_sub(&live, (long)malloc_usable_size(p));
}

void *malloc(size_t n)
{
  return add(__libc_malloc(n));
}

void *calloc(size_t n, size_t size)
{
  return add(__libc_calloc(n, size));
}

void *realloc(void *p, size_t n)
{
  void *q;

  take(p);
  q = __libc_realloc(p, n);
  return q || !n ? add(q) : (add(p), q);
}

void *memalign(size_t align, size_t n)
{
  return add(__libc_memalign(align, n));
}

void *aligned_alloc(size_t align, size_t n)
{
  return memalign(align, n);
}

int posix_memalign(void **p, size_t align, size_t n)
{
  *p = memalign(align, n);
  return *p ? 0 : ENOMEM;
}

void free(void *p)
{
  take(p);
  __libc_free(p);
}

/* As flow/flow.h has it */
int FlowBeginStep(void *flow, double time, double dt)
{
  int (*begin)(void *, double, double) = (int (*)(void *, double, double))dlsym(RTLD_NEXT, "FlowBeginStep");

  step = live;
  return begin(flow, time, dt);
}

__attribute__((destructor)) static void report(void)
{
  const char *name = getenv("HEAPCOUNT");
  FILE       *f    = name && step ? fopen(name, "a") : NULL;

  if (!f) return;
  fprintf(f, "%ld %ld\n", (long)step, (long)peak);
  fclose(f);
}
