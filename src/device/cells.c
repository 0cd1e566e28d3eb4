/* Device: cells in groups, made on the host and brought to where they are wanted. Compiled once, by the C compiler. */
#ifndef __CUDACC__
  #include "kernel.h"
  #include <stdlib.h>
  #include <string.h>

  #define G DEVICE_GROUP

/* Host arrays on their way */
typedef struct {
  int    *node, *cell, *hang;
  double *box, *position;
} Slots;

/* Way in which something hangs in a cell, from 1; 0: nothing */
static int get_colour(const DeviceMesh *m, int c)
{
  return m->hang ? m->hang[c] + 1 : 0;
}

/* order: the cells of a kind, by ways, each in their order; how many */
static int sort_cells(const DeviceMesh *m, int kind, int start[], int order[])
{
  int n = 0;

  memset(start, 0, sizeof(*start) * (size_t)(m->nhang + 2));
  for (int c = 0; c < m->ncell; c++)
    if (m->kind[c] == kind) {
      start[get_colour(m, c) + 1]++;
      n++;
    }
  for (int w = 0; w <= m->nhang; w++) start[w + 1] += start[w];
  for (int c = 0; c < m->ncell; c++)
    if (m->kind[c] == kind) order[start[get_colour(m, c)]++] = c;
  return n;
}

static void fill_slot(const DeviceMesh *m, int slot, int c, Slots *p)
{
  for (int j = 0; j < 27; j++)
    p->node[(size_t)slot * 27 + (size_t)j] = c < 0 ? -1 : m->node[(size_t)c * 27 + (size_t)j];
  p->cell[slot] = c;
  if (p->hang) p->hang[slot] = c < 0 ? -1 : m->hang[c];
}

/* Empty places are like the first of their group, so that nothing there is no number */
static void fill_boxes(const DeviceMesh *m, int ngroup, Slots *p)
{
  for (int e = 0; e < ngroup * G; e++) {
    const int c = p->cell[e] < 0 ? p->cell[e / G * G] : p->cell[e];

    for (int k = 0; k < 4; k++)
      p->box[((size_t)(e / G) * 4 + (size_t)k) * G + (size_t)(e % G)] = m->box[(size_t)c * 4 + (size_t)k];
  }
}

static void fill_positions(const DeviceMesh *m, int ngroup, const int number[], const int cell[], Slots *p)
{
  for (int e = 0; e < ngroup * G && m->position; e++) {
    const double *x = m->position + (size_t)number[cell[e] < 0 ? cell[e / G * G] : cell[e]] * 81;

    for (int k = 0; k < 81; k++) p->position[((size_t)(e / G) * 81 + (size_t)k) * G + (size_t)(e % G)] = x[k];
  }
}

static int bring(const DeviceQueue *q, size_t bytes, const void *host, const void **to)
{
  void *p = NULL;
  int   e = (*q->run->allocate)(q, bytes, &p);

  *to = p;
  return e ? e : (*q->run->upload)(q, bytes, host, p);
}

static int bring_all(const DeviceQueue *q, const DeviceMesh *m, const Slots *p, DeviceCells *c)
{
  const size_t n = (size_t)c->ngroup * G;
  int          e = bring(q, n * 27 * sizeof(int), p->node, (const void **)&c->node);

  if (!e) e = bring(q, n * sizeof(int), p->cell, (const void **)&c->cell);
  if (!e && p->hang) e = bring(q, n * sizeof(int), p->hang, (const void **)&c->hang);
  if (!e && p->hang) e = bring(q, (size_t)m->nhang * sizeof(DeviceHang), m->hangs, (const void **)&c->hangs);
  if (!e) e = bring(q, (size_t)c->nbox * 4 * G * sizeof(double), p->box, (const void **)&c->box);
  if (!e && p->position)
    e = bring(q, (size_t)(c->ngroup - c->nbox) * 81 * G * sizeof(double), p->position, (const void **)&c->position);
  return e;
}

static int reserve(const DeviceMesh *m, const DeviceCells *c, Slots *p)
{
  const size_t n = (size_t)c->ngroup * G;

  p->node     = malloc(n * 27 * sizeof(int) + 1);
  p->cell     = malloc(n * sizeof(int) + 1);
  p->hang     = m->nhang ? malloc(n * sizeof(int) + 1) : NULL;
  p->box      = malloc((size_t)c->nbox * 4 * G * sizeof(double) + 1);
  p->position = m->position ? malloc((size_t)(c->ngroup - c->nbox) * 81 * G * sizeof(double) + 1) : NULL;
  return !p->node || !p->cell || (m->nhang && !p->hang) || !p->box || (m->position && !p->position);
}

static int create(const DeviceQueue *q, const DeviceMesh *m, int order[], int start[], DeviceCells *c)
{
  const int nbox = sort_cells(m, DEVICE_BOX, start, order), nother = sort_cells(m, DEVICE_OTHER, start, order + nbox);
  int       others = 0, failed;
  Slots     p;

  *c        = (DeviceCells){.nnode = m->nnode, .ncell = m->ncell, .nbox = (nbox + G - 1) / G};
  c->ngroup = c->nbox + (nother + G - 1) / G;
  failed    = reserve(m, c, &p);
  if (!failed) {
    for (int e = 0; e < c->nbox * G; e++) fill_slot(m, e, e < nbox ? order[e] : -1, &p);
    for (int e = c->nbox * G, k = nbox; e < c->ngroup * G; e++, k++)
      fill_slot(m, e, k < nbox + nother ? order[k] : -1, &p);
    fill_boxes(m, c->nbox, &p);
    for (int k = 0; k < m->ncell; k++) order[k] = m->kind[k] == DEVICE_OTHER ? others++ : -1; /* in `position` */
    fill_positions(m, c->ngroup - c->nbox, order, p.cell + c->nbox * G, &p);
    failed = bring_all(q, m, &p, c);
  }
  free(p.node);
  free(p.cell);
  free(p.hang);
  free(p.box);
  free(p.position);
  return failed;
}

int DeviceCellsCreate(const DeviceQueue *q, const DeviceMesh *m, DeviceCells *c)
{
  int *order = malloc(sizeof(int) * (size_t)(m->ncell + 1)), *start = malloc(sizeof(int) * (size_t)(m->nhang + 2)),
      failed = !order || !start || m->nnode > DEVICE_MAX_NODES;

  if (!failed) failed = create(q, m, order, start, c);
  free(order);
  free(start);
  return failed;
}

int DeviceCellsDestroy(const DeviceQueue *q, DeviceCells *c)
{
  const void *array[] = {c->node, c->cell, c->hang, c->hangs, c->box, c->position};
  int         e       = 0;

  for (size_t i = 0; i < sizeof(array) / sizeof(*array); i++)
    if (array[i] && !e) e = (*q->run->release)(q, (void *)array[i]);
  *c = (DeviceCells){0};
  return e;
}
#endif
