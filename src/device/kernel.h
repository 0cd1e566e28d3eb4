/* Kernel: one source for GPU and processor. A file of kernels is compiled by the C compiler as it is, and by nvcc (-x
   cu) where there is CUDA. It is written in the subset of C that C++ takes, and in these words:

     KERNEL(threads, blocks) name(...)   blocks of so many threads; at least so many of them on a multiprocessor
     EACH_THREAD(t, threads) { ... }     all threads of the block: the thread on a GPU, a loop on the processor
     BARRIER                             between two such pieces: what was SHARED is seen by all
     EACH(i, n) ...                      all i < n, of kernels without SHARED
     LAUNCH(queue, kernel, blocks, threads, ...)

   `return EndKernel(queue, __func__, bytes)` ends a function, with what it reads and writes at least.
   Nothing but what is SHARED lives longer than one EACH_THREAD. ADD adds to a number that other threads add to as well.
   Functions of a file are called NAME(verb); table.c collects them. */
#pragma once
#include "device/device.h"

#include <string.h>
#include <time.h>

typedef long long Big;

#ifdef __CUDACC__
  #include <cuda_runtime.h>
  #define NAME(f)                 f##_cuda
  #define DEV                     static __device__ __forceinline__
  #define BOTH                    static inline __host__ __device__
  #define HOST                    static inline
  #define RESTRICT                __restrict__
  #define KERNEL(threads, blocks) static __global__ void __launch_bounds__(threads, blocks)
  #define SHARED                  __shared__
  #define EACH_THREAD(t, threads) for (int t = (int)threadIdx.x, once_ = 1; once_; once_ = 0)
  #define EACH(i, n)              for (Big i = (Big)blockIdx.x * blockDim.x + threadIdx.x; i < (n); i += (Big)gridDim.x * blockDim.x)
  #define BARRIER                 __syncthreads()
  #define BLOCK                   ((int)blockIdx.x)
  #define ADD(to, value)          atomicAdd(&(to), value)
  #define PRAGMA(x)               _Pragma(#x)
  #define UNROLL                  _Pragma("unroll")
  #define UNROLL_BY(n)            PRAGMA(unroll n)
  #define LAUNCH(queue, kernel, blocks, threads, ...) \
    do { \
      BeginKernel(queue); \
      if ((blocks) > 0) \
        kernel<<<(unsigned)(blocks), (unsigned)(threads), 0, (cudaStream_t)(queue)->stream>>>(__VA_ARGS__); \
    } while (0)
  #define LAST_ERROR()    ((int)cudaGetLastError())
  #define WAIT_FOR(queue) ((int)cudaStreamSynchronize((cudaStream_t)(queue)->stream))
#else
  #define NAME(f)                 f##_cpu
  #define DEV                     static inline __attribute__((always_inline))
  #define BOTH                    static inline
  #define HOST                    static inline
  #define RESTRICT                restrict
  #define KERNEL(threads, blocks) static void
  #define SHARED
  #define EACH_THREAD(t, threads) for (int t = 0; t < (threads); t++)
  #define EACH(i, n)              for (Big i = 0; i < (n); i++)
  #define BARRIER                 ((void)0)
  #define BLOCK                   block_now
  #define ADD(to, value)          ((to) += (value))
  #define UNROLL
  #define UNROLL_BY(n)
  #define LAUNCH(queue, kernel, blocks, threads, ...) \
    do { \
      BeginKernel(queue); \
      for (block_now = 0; block_now < (int)(blocks); block_now++) kernel(__VA_ARGS__); \
    } while (0)
  #define LAST_ERROR()    0
  #define WAIT_FOR(queue) 0
static _Thread_local int block_now __attribute__((unused));
#endif

/* ---- what kernels take, where somebody asks ---- */

HOST double SecondsNow(void)
{
  struct timespec t;

  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

HOST void BeginKernel(const DeviceQueue *queue)
{
  DeviceCounts *c = queue->traffic ? queue->traffic->counts : NULL;

  if (!c || c->begun > 0) return;
  (void)WAIT_FOR(queue);
  c->begun = SecondsNow();
}

/* The error of the kernels since BeginKernel */
HOST int EndKernel(const DeviceQueue *queue, const char *name, double bytes)
{
  DeviceCounts *c     = queue->traffic ? queue->traffic->counts : NULL;
  int           error = LAST_ERROR(), k = 0;

  if (!c) return error;
  if (!error) error = WAIT_FOR(queue);
  while (k < c->n && strcmp(c->count[k].name, name) != 0) k++;
  if (k == DEVICE_COUNTS) return error;
  if (k == c->n) c->n++;
  c->count[k].name = name;
  c->count[k].calls++;
  c->count[k].bytes += bytes;
  if (c->begun > 0) c->count[k].seconds += SecondsNow() - c->begun;
  c->begun = 0;
  return error;
}

/* Blocks of 256 threads for EACH: on the processor one that goes through all */
HOST int BlocksFor(Big n)
{
#ifdef __CUDACC__
  const Big limit = 132 * 16;

  return (int)((n + 255) / 256 < limit ? (n + 255) / 256 : limit);
#else
  return n > 0;
#endif
}
