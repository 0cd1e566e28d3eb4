/* Device: memory of the processor or of the GPU that is current. */
#include "functions.h"
#include <stdlib.h>
#include <string.h>

/* What has gone over, since BeginKernel */
HOST void count(const DeviceQueue *queue, const char *name, size_t up, size_t down)
{
  if (!queue->traffic) return;
  (void)EndKernel(queue, name, (double)(up + down));
  queue->traffic->up += (double)up;
  queue->traffic->down += (double)down;
}

#ifdef __CUDACC__
int NAME(allocate)(const DeviceQueue *queue, size_t bytes, void **p)
{
  const int error = (int)cudaMalloc(p, bytes ? bytes : 1);
  size_t    unused, all;

  /* asked for where kernels are counted alone: it takes time */
  if (!error && queue->traffic && queue->traffic->counts && cudaMemGetInfo(&unused, &all) == cudaSuccess &&
      (double)(all - unused) > queue->traffic->most)
    queue->traffic->most = (double)(all - unused);
  return error;
}

int NAME(release)(const DeviceQueue *queue, void *p)
{
  (void)queue;
  return (int)cudaFree(p);
}

/* Both wait: what is on the host may be pageable, and is the caller's again */
int NAME(upload)(const DeviceQueue *queue, size_t bytes, const void *host, void *to)
{
  cudaError_t e;

  BeginKernel(queue);
  e = cudaMemcpyAsync(to, host, bytes, cudaMemcpyHostToDevice, (cudaStream_t)queue->stream);
  if (!e) e = cudaStreamSynchronize((cudaStream_t)queue->stream);
  count(queue, __func__, bytes, 0);
  return (int)e;
}

int NAME(download)(const DeviceQueue *queue, size_t bytes, const void *from, void *host)
{
  cudaError_t e;

  BeginKernel(queue);
  e = cudaMemcpyAsync(host, from, bytes, cudaMemcpyDeviceToHost, (cudaStream_t)queue->stream);
  if (!e) e = cudaStreamSynchronize((cudaStream_t)queue->stream);
  count(queue, __func__, 0, bytes);
  return (int)e;
}

int NAME(zero)(const DeviceQueue *queue, size_t bytes, void *p)
{
  BeginKernel(queue);
  (void)cudaMemsetAsync(p, 0, bytes, (cudaStream_t)queue->stream);
  return EndKernel(queue, __func__, (double)bytes);
}

int NAME(wait)(const DeviceQueue *queue)
{
  return (int)cudaStreamSynchronize((cudaStream_t)queue->stream);
}

const char *NAME(explain)(int error)
{
  return cudaGetErrorString((cudaError_t)error);
}
#else
/* How much was taken stands before it */
  #define HEADER 64

static void count_taken(const DeviceQueue *queue, double bytes)
{
  DeviceTraffic *t = queue->traffic;

  if (!t) return;
  t->taken += bytes;
  if (t->taken > t->most) t->most = t->taken;
}

int NAME(allocate)(const DeviceQueue *queue, size_t bytes, void **p)
{
  char *all = malloc(bytes + HEADER);

  *p = NULL;
  if (!all) return 1;
  memcpy(all, &bytes, sizeof(bytes));
  *p = all + HEADER;
  count_taken(queue, (double)bytes);
  return 0;
}

int NAME(release)(const DeviceQueue *queue, void *p)
{
  size_t bytes = 0;

  if (!p) return 0;
  memcpy(&bytes, (char *)p - HEADER, sizeof(bytes));
  count_taken(queue, -(double)bytes);
  free((char *)p - HEADER);
  return 0;
}

int NAME(upload)(const DeviceQueue *queue, size_t bytes, const void *host, void *to)
{
  BeginKernel(queue);
  if (bytes) memcpy(to, host, bytes);
  count(queue, __func__, bytes, 0);
  return 0;
}

int NAME(download)(const DeviceQueue *queue, size_t bytes, const void *from, void *host)
{
  BeginKernel(queue);
  if (bytes) memcpy(host, from, bytes);
  count(queue, __func__, 0, bytes);
  return 0;
}

int NAME(zero)(const DeviceQueue *queue, size_t bytes, void *p)
{
  BeginKernel(queue);
  if (bytes) memset(p, 0, bytes);
  return EndKernel(queue, __func__, (double)bytes);
}

int NAME(wait)(const DeviceQueue *queue)
{
  (void)queue;
  return 0;
}

const char *NAME(explain)(int error)
{
  return error ? "out of memory" : "no error";
}
#endif
