/* AlignJoin: see align/join.h. */
#include "compat.h"
#include "align/join.h"
#include "base/array.h"

struct _p_AlignJoin {
  MPI_Comm              comm;
  PetscInt              n, *first; /* owners; [n + 1] */
  const AlignSurfaces **member;    /* [n] */
  AlignSurfaces         table;
  PetscInt              capacity, *number;
  PetscBool            *own, *inactive;
  PetscReal (*centre)[3], *radius, *round, *volume;
};

PetscInt AlignJoinFindOwner(AlignJoin j, PetscInt *k)
{
  PetscInt i = 0;

  while (*k >= j->first[i + 1]) i++;
  *k -= j->first[i];
  return i;
}

/* Whose surface k is, which becomes the number that he has for it */
static const AlignSurfaces *member_of(void *ctx, PetscInt *k)
{
  const AlignJoin j = (AlignJoin)ctx;

  return j->member[AlignJoinFindOwner(j, k)];
}

/* ---- what the table asks ---- */

static PetscErrorCode distance(void *ctx, PetscInt k, const PetscReal at[3], PetscInt m, const PetscReal x[],
                               PetscReal d[])
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  PetscCall((*s->distance)(s->ctx, k, at, m, x, d));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode project(void *ctx, PetscInt k, PetscInt m, const PetscReal x[], PetscReal y[])
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  PetscCall((*s->project)(s->ctx, k, m, x, y));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode corners(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal x[])
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  *m = 0;
  if (s->corners) PetscCall((*s->corners)(s->ctx, k, max, m, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode points(void *ctx, PetscInt k, PetscInt max, PetscInt *m, PetscReal **x)
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  *m = 0;
  *x = NULL;
  if (s->points) PetscCall((*s->points)(s->ctx, k, max, m, x));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode midline(void *ctx, PetscInt k, PetscReal limit, Midline *line)
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  *line = NULL;
  if (s->midline) PetscCall((*s->midline)(s->ctx, k, limit, line));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode frame(void *ctx, PetscInt k, PetscReal R[9], PetscReal centre[2])
{
  const AlignSurfaces *s = member_of(ctx, &k);

  PetscFunctionBeginUser;
  PetscCall((*s->frame)(s->ctx, k, R, centre)); /* of who has a mid-line alone */
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Of all ranks that know a surface: who has surfaces that all know has no operation of his own */
static PetscErrorCode reduce(AlignJoin j, PetscBool sum, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < j->n; i++) {
    const AlignSurfaces *s    = j->member[i];
    PetscReal           *mine = v + width * j->first[i];
    PetscMPIInt          n;

    PetscCall(PetscMPIIntCast(width * s->n, &n));
    if (s->sum) PetscCall((sum ? *s->sum : *s->max)(s->ctx, width, mine));
    else PetscCall(MPIU_Allreduce(MPI_IN_PLACE, mine, n, MPIU_REAL, sum ? MPIU_SUM : MPIU_MAX, j->comm));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode sum(void *ctx, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(reduce((AlignJoin)ctx, PETSC_TRUE, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode max(void *ctx, PetscInt width, PetscReal v[])
{
  PetscFunctionBeginUser;
  PetscCall(reduce((AlignJoin)ctx, PETSC_FALSE, width, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- life cycle ---- */

PetscErrorCode AlignJoinCreate(MPI_Comm comm, PetscInt n, const AlignSurfaces *const table[], AlignJoin *join)
{
  AlignJoin j;
  PetscBool spread = PETSC_FALSE;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&j));
  j->comm = comm;
  j->n    = n;
  PetscCall(PetscCalloc2(n, &j->member, n + 1, &j->first));
  for (PetscInt i = 0; i < n; i++) {
    PetscCheck(n == 1 || (!table[i]->ends_on && !table[i]->approach && !table[i]->closed), comm, PETSC_ERR_PLIB,
               "Fluid surfaces cannot be joined with others");
    j->member[i] = table[i];
    spread       = (PetscBool)(spread || table[i]->sum);
  }
  j->table = (AlignSurfaces){.ctx      = j,
                             .distance = distance,
                             .project  = project,
                             .corners  = corners,
                             .points   = points,
                             .midline  = midline,
                             .frame    = frame,
                             .sum      = spread ? sum : NULL,
                             .max      = spread ? max : NULL};
  *join    = j;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignJoinDestroy(AlignJoin *join)
{
  AlignJoin j = *join;

  PetscFunctionBeginUser;
  if (!j) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree2(j->member, j->first));
  PetscCall(PetscFree(j->number));
  PetscCall(PetscFree(j->own));
  PetscCall(PetscFree(j->inactive));
  PetscCall(PetscFree(j->centre));
  PetscCall(PetscFree(j->radius));
  PetscCall(PetscFree(j->round));
  PetscCall(PetscFree(j->volume));
  PetscCall(PetscFree(*join));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* Surfaces of owner i, whose numbers begin at `offset`; counts: does this rank count those that all know? */
static PetscErrorCode copy_surfaces(AlignJoin j, PetscInt i, PetscInt offset, PetscBool counts)
{
  const AlignSurfaces *s = j->member[i];

  PetscFunctionBeginUser;
  for (PetscInt k = 0; k < s->n; k++) {
    const PetscInt to = j->first[i] + k;

    j->number[to]   = offset + s->number[k];
    j->own[to]      = (PetscBool)(s->own[k] && (s->sum || counts));
    j->inactive[to] = AlignLeavesFluid(s, k);
    j->radius[to]   = s->radius[k];
    j->round[to]    = s->round[k];
    j->volume[to]   = s->volume[k];
    PetscCall(PetscArraycpy(j->centre[to], s->centre[k], 3));
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode AlignJoinUpdate(AlignJoin j)
{
  AlignSurfaces *t = &j->table;
  PetscMPIInt    rank;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(j->comm, &rank));
  for (PetscInt i = 0; i < j->n; i++) j->first[i + 1] = j->first[i] + j->member[i]->n;
  if (j->n == 1) PetscFunctionReturn(PETSC_SUCCESS);
  t->n    = j->first[j->n];
  t->nall = 0;
  PetscCall(ArrayReserve(t->n, &j->capacity, &j->number, sizeof(*j->number), &j->own, sizeof(*j->own), &j->inactive,
                         sizeof(*j->inactive), &j->centre, sizeof(*j->centre), &j->radius, sizeof(*j->radius),
                         &j->round, sizeof(*j->round), &j->volume, sizeof(*j->volume), NULL));
  for (PetscInt i = 0; i < j->n; i++) {
    PetscCall(copy_surfaces(j, i, t->nall, (PetscBool)(!t->sum || rank == 0)));
    t->nall += j->member[i]->nall;
    t->largest = PetscMax(t->largest, j->member[i]->largest);
  }
  t->number          = j->number;
  t->own             = j->own;
  t->inactive_inside = j->inactive;
  t->centre          = (const PetscReal(*)[3])j->centre;
  t->radius          = j->radius;
  t->round           = j->round;
  t->volume          = j->volume;
  PetscFunctionReturn(PETSC_SUCCESS);
}

const PetscInt *AlignJoinGetFirst(AlignJoin j)
{
  return j->first;
}

const AlignSurfaces *AlignJoinGet(AlignJoin j)
{
  return j->n == 1 ? j->member[0] : &j->table;
}
