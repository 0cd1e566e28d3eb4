/* Device: rows of the pressure operator, made where they are kept, from the cells' matrices and the weights of nodes.
   A block has one row, a thread a block of it after the other. What bodies add to the blocks on the diagonal comes
   before these are inverted. */
#include "cell.h"
#include "functions.h"

#define LANES 32

/* Place of a cell in groups: its matrix and nodes */
typedef struct {
  const double *b;
  const int    *node;
  int           stride; /* of b */
} CellData;

DEV CellData cell_of(const DeviceCells c, const DeviceDivergence d, const int place)
{
  const int box = place / G < c.nbox;
  CellData  p;

  p.b      = find_matrix(box, c, d, place / G, place % G);
  p.node   = c.node + (Big)place * 27;
  p.stride = box ? 1 : G;
  return p;
}

/* sum [16], column by column, += the part of two cells: own [27][12] of nodes `node` is weight times the first's matrix
 */
DEV void add_shared_nodes(const CellData other, const int *node, const double *own, double *sum)
{
  for (int j = 0; j < 27; j++) {
    const int e = NODE(other.node[j]);

    for (int i = 0; i < 27; i++) {
      if (node[i] != e) continue;
      for (int a = 0; a < 3; a++)
        for (int m = 0; m < 4; m++) {
          const double b = other.b[((3 * j + a) * 4 + m) * other.stride];

          UNROLL
          for (int k = 0; k < 4; k++) sum[4 * m + k] += own[i * 12 + a * 4 + k] * b;
        }
    }
  }
}

KERNEL(LANES, 16)
make(const DeviceCells c, const DeviceDivergence d, const int *RESTRICT place, const double *RESTRICT weight,
     const int *RESTRICT row, const int *RESTRICT at, const DeviceRows r)
{
  SHARED double own[27 * 12];
  SHARED int    node[27];
  const int     i = row[BLOCK];

  EACH_THREAD(t, LANES)
  {
    const CellData p = cell_of(c, d, place[i]);

    if (t == 0) r.at[i] = at[BLOCK];
    for (int j = t; j < 27; j += LANES) {
      node[j] = NODE(p.node[j]);
      for (int e = 0; e < 12; e++) own[j * 12 + e] = weight[(Big)node[j] * 3 + e / 4] * p.b[(12 * j + e) * p.stride];
    }
  }
  BARRIER;
  EACH_THREAD(t, LANES)
  for (int q = r.start[i] + t; q < r.start[i + 1]; q += LANES) {
    const Big to      = ((Big)at[BLOCK] + q - r.start[i]) * 16;
    double    sum[16] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};

    add_shared_nodes(cell_of(c, d, place[r.column[q]]), node, own, sum);
    UNROLL
    for (int e = 0; e < 16; e++) {
      r.value[to + e]  = sum[e];
      r.single[to + e] = (float)sum[e];
    }
  }
}

int NAME(make_rows)(const DeviceQueue *queue, const DeviceCells *cells, const DeviceDivergence *d, const int place[],
                    const double weight[], int n, const int row[], const int at[], const DeviceRows *rows)
{
  LAUNCH(queue, make, n, LANES, *cells, *d, place, weight, row, at, *rows);
  return EndKernel(queue, __func__, n * (27. * 16 * 12 + 27 * 27 * 4));
}

/* Where the block on the diagonal of row i begins, in numbers */
DEV Big find_diagonal(const DeviceRows r, const int i)
{
  int q = r.start[i];

  while (r.column[q] != i) q++;
  return ((Big)r.at[i] + q - r.start[i]) * 16;
}

KERNEL(256, 1)
add_blocks(const int n, const int *RESTRICT row, const double *RESTRICT block, const DeviceRows r)
{
  EACH(k, n)
  {
    const Big to = find_diagonal(r, row[k]);

    for (int e = 0; e < 16; e++) {
      r.value[to + e] += block[k * 16 + e];
      r.single[to + e] = (float)r.value[to + e];
    }
  }
}

int NAME(add_to_diagonal)(const DeviceQueue *queue, int n, const int row[], const double block[],
                          const DeviceRows *rows)
{
  LAUNCH(queue, add_blocks, BlocksFor(n), 256, n, row, block, *rows);
  return EndKernel(queue, __func__, n * 452.);
}

KERNEL(256, 1) narrow_numbers(const Big n, const double *RESTRICT from, float *to)
{
  EACH(i, n) to[i] = (float)from[i];
}

int NAME(narrow)(const DeviceQueue *queue, size_t n, const double from[], float to[])
{
  LAUNCH(queue, narrow_numbers, BlocksFor((Big)n), 256, (Big)n, from, to);
  return EndKernel(queue, __func__, 12. * (double)n);
}

/* ---- inverses ---- */

KERNEL(256, 1) pick_diagonals(const int n, const int *RESTRICT row, const DeviceRows r, int *where, double *block)
{
  EACH(k, n)
  {
    const Big from = find_diagonal(r, row[k]);

    where[row[k]] = (int)k;
    for (int e = 0; e < 16; e++) block[k * 16 + e] = r.value[from + e];
  }
}

/* w w^T of pairs of a body and a cell */
KERNEL(256, 1) add_squares(const DevicePairs p, const int *RESTRICT where, double *block)
{
  EACH(e, p.n)
  {
    double *to = block + (Big)where[p.at[e]] * 16, w[24];

    UNROLL
    for (int i = 0; i < 24; i++) w[i] = p.value[(Big)i * p.n + e];
    UNROLL
    for (int i = 0; i < 16; i++) {
      double sum = 0;

      for (int m = 0; m < 6; m++) sum += w[i / 4 * 6 + m] * w[i % 4 * 6 + m];
      ADD(to[i], sum);
    }
  }
}

/* a [16] <- its inverse, by Gauss and Jordan, which is enough for definite ones */
DEV void invert_block(double *a)
{
  UNROLL
  for (int i = 0; i < 4; i++) {
    const double pivot = a[5 * i] == 0 ? 0 : 1 / a[5 * i];

    a[5 * i] = 1;
    for (int j = 0; j < 4; j++) a[4 * i + j] *= pivot;
    UNROLL
    for (int k = 0; k < 4; k++) {
      const double m = a[4 * k + i];

      if (k == i) continue;
      a[4 * k + i] = 0;
      for (int j = 0; j < 4; j++) a[4 * k + j] -= m * a[4 * i + j];
    }
  }
}

KERNEL(256, 1) invert(const int n, const int *RESTRICT row, const double *RESTRICT block, const DeviceRows r)
{
  EACH(k, n)
  {
    double a[16];

    UNROLL
    for (int e = 0; e < 16; e++) a[e] = block[k * 16 + e];
    invert_block(a);
    UNROLL
    for (int e = 0; e < 16; e++) r.inverse[(Big)r.kind[row[k]] * 16 + e] = (float)a[e];
  }
}

int NAME(invert_rows)(const DeviceQueue *queue, int n, const int row[], const DevicePairs *pairs, int where[],
                      double block[], const DeviceRows *rows)
{
  LAUNCH(queue, pick_diagonals, BlocksFor(n), 256, n, row, *rows, where, block);
  LAUNCH(queue, add_squares, BlocksFor(pairs->n), 256, *pairs, where, block);
  LAUNCH(queue, invert, BlocksFor(n), 256, n, row, block, *rows);
  return EndKernel(queue, __func__, n * 580. + pairs->n * 448.);
}
