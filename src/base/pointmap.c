/* PointMap: see pointmap.h. Points travel as records of four numbers: coordinates and an index. */
#include "compat.h"
#include "base/pointmap.h"
#include "base/mix.h"
#include "base/rowtype.h"
#include <stdint.h>
#include <stdlib.h>

#define RECORD 4    /* coordinates (unused ones zero), index */
#define WIDTH  4096 /* of the rounding in tolerances: large, so that few points lie near a border of it */

typedef struct {
  uint64_t         hash;
  const PetscReal *record;
} Entry;

typedef struct {
  MPI_Comm    comm;
  PetscMPIInt size;
  PetscInt    dim;
  PetscReal   tolerance;
} Context;

/* ---- hashes ---- */

/* Of the rounded coordinates */
static uint64_t hash_box(const PetscInt64 box[3])
{
  uint64_t z = 0;

  for (int d = 0; d < 3; d++) { z = Mix64(z + (uint64_t)box[d] + MIX_STEP); }
  return z;
}

/* Hashes of all boxes that a partner of x may lie in: one, or two an axis near a border. Returns their number. */
static int hash_near(const Context *c, const PetscReal x[3], PetscReal reach, uint64_t hash[8])
{
  const PetscReal width = WIDTH * c->tolerance;
  PetscInt64      box[3][2];
  int             n = 0, two[3];

  for (int d = 0; d < 3; d++) {
    box[d][0] = (PetscInt64)PetscFloorReal((x[d] - reach) / width);
    box[d][1] = (PetscInt64)PetscFloorReal((x[d] + reach) / width);
    two[d]    = box[d][1] > box[d][0];
  }
  for (int i = 0; i < 8; i++) {
    const PetscInt64 b[3] = {box[0][i & 1], box[1][(i >> 1) & 1], box[2][i >> 2]};

    if ((i & 1 && !two[0]) || (i & 2 && !two[1]) || (i & 4 && !two[2])) continue;
    hash[n++] = hash_box(b);
  }
  return n;
}

/* ---- travel ---- */

/* Records of the points x [n][dim] for the ranks that keep the directory of their boxes, by rank: count [size], *record
   [sum][RECORD]. index: first index. */
static PetscErrorCode pack(const Context *c, PetscInt n, const PetscReal x[], PetscReal reach, PetscInt first,
                           PetscMPIInt count[], PetscReal **record)
{
  PetscInt *at, total = 0;

  PetscFunctionBeginUser;
  PetscCall(PetscCalloc1(c->size, &at));
  for (PetscInt pass = 0; pass < 2; pass++) {
    if (pass) {
      for (PetscMPIInt r = 0; r < c->size; r++) {
        PetscCall(PetscMPIIntCast(at[r], &count[r]));
        at[r] = total;
        total += count[r];
      }
      PetscCall(PetscMalloc1(total * RECORD, record));
    }
    for (PetscInt i = 0; i < n; i++) {
      PetscReal y[3] = {0, 0, 0};
      uint64_t  hash[8];
      int       boxes;

      for (PetscInt d = 0; d < c->dim; d++) y[d] = x[i * c->dim + d];
      boxes = hash_near(c, y, reach, hash);
      for (int b = 0; b < boxes; b++) {
        const PetscMPIInt to = (PetscMPIInt)(hash[b] % (uint64_t)c->size);

        if (pass) {
          PetscReal *r = *record + RECORD * at[to];

          PetscCall(PetscArraycpy(r, y, 3));
          r[3] = (PetscReal)(first + i);
        }
        at[to]++;
      }
    }
  }
  PetscCall(PetscFree(at));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Send out [sum of count][bs], receive *in; back [size] counts what came. Both counts in blocks. */
static PetscErrorCode exchange(const Context *c, PetscInt bs, const PetscMPIInt count[], const PetscReal out[],
                               PetscMPIInt back[], PetscReal **in)
{
  PetscMPIInt *offset, total[2] = {0, 0};
  MPI_Datatype block;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(2 * c->size, &offset));
  PetscCallMPI(MPI_Alltoall(count, 1, MPI_INT, back, 1, MPI_INT, c->comm));
  for (PetscMPIInt r = 0; r < c->size; r++) {
    offset[r]           = total[0];
    offset[c->size + r] = total[1];
    total[0] += count[r];
    total[1] += back[r];
  }
  PetscCall(PetscMalloc1(total[1] * bs, in));
  PetscCall(RowTypeCreate(bs, &block));
  PetscCallMPI(MPI_Alltoallv(out, count, offset, block, *in, back, offset + c->size, block, c->comm));
  PetscCall(RowTypeDestroy(&block));
  PetscCall(PetscFree(offset));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- the directory ---- */

static int compare_entries(const void *a, const void *b)
{
  const uint64_t x = ((const Entry *)a)->hash, y = ((const Entry *)b)->hash;

  return x < y ? -1 : x > y;
}

/* Index of the record at x, or -1 */
static PetscReal look_up(const Context *c, PetscInt n, const Entry table[], const PetscReal x[3])
{
  uint64_t hash[8];
  int      boxes = hash_near(c, x, c->tolerance, hash);

  for (int b = 0; b < boxes; b++) {
    PetscInt low = 0, high = n;

    while (low < high) {
      const PetscInt middle = low + (high - low) / 2;

      if (table[middle].hash < hash[b]) low = middle + 1;
      else high = middle;
    }
    for (; low < n && table[low].hash == hash[b]; low++) {
      const PetscReal *y = table[low].record;

      if (PetscAbsReal(x[0] - y[0]) <= c->tolerance && PetscAbsReal(x[1] - y[1]) <= c->tolerance &&
          PetscAbsReal(x[2] - y[2]) <= c->tolerance)
        return y[3];
    }
  }
  return -1;
}

/* answer [nquestion]: index of the root at each of the questions */
static PetscErrorCode answer_questions(const Context *c, PetscInt nroot, const PetscReal root[], PetscInt nquestion,
                                       const PetscReal question[], PetscReal answer[])
{
  Entry *table;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(nroot, &table));
  for (PetscInt i = 0; i < nroot; i++) {
    uint64_t hash[8];

    (void)hash_near(c, root + RECORD * i, 0, hash);
    table[i] = (Entry){hash[0], root + RECORD * i};
  }
  if (nroot) qsort(table, (size_t)nroot, sizeof(*table), compare_entries);
  for (PetscInt i = 0; i < nquestion; i++) answer[i] = look_up(c, nroot, table, question + RECORD * i);
  PetscCall(PetscFree(table));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscInt sum_counts(const Context *c, const PetscMPIInt count[])
{
  PetscInt sum = 0;

  for (PetscMPIInt r = 0; r < c->size; r++) sum += count[r];
  return sum;
}

/* partner [nleaf]: global index of the root at each leaf, or -1 */
static PetscErrorCode match_points(const Context *c, PetscInt nroot, const PetscReal xroot[], PetscInt nleaf,
                                   const PetscReal xleaf[], PetscInt match[])
{
  PetscInt     start = 0;
  PetscMPIInt *count; /* roots sent, received, questions sent, received, answers */
  PetscReal   *root, *roots, *question, *questions, *answer, *answers;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Exscan(&nroot, &start, 1, MPIU_INT, MPI_SUM, c->comm));
  PetscCall(PetscMalloc1(5 * c->size, &count));
  PetscCall(pack(c, nroot, xroot, 0, start, count, &root));
  PetscCall(exchange(c, RECORD, count, root, count + c->size, &roots));
  PetscCall(pack(c, nleaf, xleaf, c->tolerance, 0, count + 2 * c->size, &question));
  PetscCall(exchange(c, RECORD, count + 2 * c->size, question, count + 3 * c->size, &questions));
  PetscCall(PetscMalloc1(sum_counts(c, count + 3 * c->size), &answer));
  PetscCall(
    answer_questions(c, sum_counts(c, count + c->size), roots, sum_counts(c, count + 3 * c->size), questions, answer));
  PetscCall(exchange(c, 1, count + 3 * c->size, answer, count + 4 * c->size, &answers));
  for (PetscInt i = 0; i < nleaf; i++) match[i] = -1;
  for (PetscInt i = 0; i < sum_counts(c, count + 2 * c->size); i++)
    if (answers[i] >= 0) match[(PetscInt)question[RECORD * i + 3]] = (PetscInt)answers[i];
  PetscCall(PetscFree(count));
  PetscCall(PetscFree(root));
  PetscCall(PetscFree(roots));
  PetscCall(PetscFree(question));
  PetscCall(PetscFree(questions));
  PetscCall(PetscFree(answer));
  PetscCall(PetscFree(answers));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* One point without a partner, the same on all ranks */
static PetscErrorCode choose_example(const Context *c, PetscInt nleaf, const PetscReal xleaf[], const PetscInt match[],
                                     PetscReal where[])
{
  PetscInt    i = 0;
  PetscMPIInt rank, mine;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(c->comm, &rank));
  while (i < nleaf && match[i] >= 0) i++;
  mine = i < nleaf ? rank : c->size;
  PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, &mine, 1, MPI_INT, MPI_MIN, c->comm));
  if (rank == mine) PetscCall(PetscArraycpy(where, xleaf + i * c->dim, c->dim));
  PetscCallMPI(MPI_Bcast(where, (PetscMPIInt)c->dim, MPIU_REAL, mine, c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode PointMapCreate(MPI_Comm comm, PetscInt dim, PetscReal tolerance, PetscInt nroot, const PetscReal xroot[],
                              PetscInt nleaf, const PetscReal xleaf[], PetscSF *sf, PetscInt *missing,
                              PetscReal where[])
{
  Context     c = {.comm = comm, .dim = dim, .tolerance = tolerance};
  PetscInt   *match;
  PetscLayout layout;

  PetscFunctionBeginUser;
  PetscCheck(dim >= 1 && dim <= 3 && tolerance > 0, comm, PETSC_ERR_ARG_OUTOFRANGE,
             "Points of dimension %" PetscInt_FMT ", tolerance %g: use 1 to 3, > 0", dim, (double)tolerance);
  PetscCallMPI(MPI_Comm_size(comm, &c.size));
  PetscCall(PetscMalloc1(nleaf, &match));
  PetscCall(match_points(&c, nroot, xroot, nleaf, xleaf, match));
  *sf      = NULL;
  *missing = 0;
  for (PetscInt i = 0; i < nleaf; i++) *missing += match[i] < 0;
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, missing, 1, MPIU_INT, MPI_SUM, comm));
  if (*missing) PetscCall(choose_example(&c, nleaf, xleaf, match, where));
  else {
    PetscCall(PetscLayoutCreateFromSizes(comm, nroot, PETSC_DETERMINE, 1, &layout));
    PetscCall(PetscSFCreate(comm, sf));
    PetscCall(PetscSFSetGraphLayout(*sf, layout, nleaf, NULL, PETSC_COPY_VALUES, match));
    PetscCall(PetscSFSetUp(*sf));
    PetscCall(PetscLayoutDestroy(&layout));
  }
  PetscCall(PetscFree(match));
  PetscFunctionReturn(PETSC_SUCCESS);
}
