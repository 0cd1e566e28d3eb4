/* Rows: what all bodies have together, over the ranks: see local.h. */
#include "compat.h"
#include "base/runcomm.h"
#include "impl.h"
#include "bodies/local.h"
#include "base/rowtype.h"

/* ---- over all ranks ---- */

PetscErrorCode BodiesMax(Bodies b, PetscInt n, PetscReal v[])
{
  PetscMPIInt count;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(n, &count));
  if (b->subdomains) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, v, count, MPIU_REAL, MPIU_MAX, BodiesComm(b)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesMin(Bodies b, PetscInt n, PetscReal v[])
{
  PetscMPIInt count;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(n, &count));
  if (b->subdomains) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, v, count, MPIU_REAL, MPIU_MIN, BodiesComm(b)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesSum(Bodies b, PetscInt n, PetscReal v[])
{
  PetscMPIInt count;

  PetscFunctionBeginUser;
  PetscCall(PetscMPIIntCast(n, &count));
  if (b->subdomains) PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, v, count, MPIU_REAL, MPIU_SUM, BodiesComm(b)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesAny(Bodies b, PetscBool *any)
{
  PetscFunctionBeginUser;
  if (b->subdomains && b->state.nall)
    PetscCallMPI(MPI_Allreduce(MPI_IN_PLACE, any, 1, COMPAT_MPI_BOOL, MPI_LOR, BodiesComm(b)));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* ---- rows ---- */

PetscErrorCode BodiesBeginRows(Bodies b, BodyRows *rows)
{
  const BodyArrays *s = &b->state;
  PetscMPIInt       rank;
  PetscInt         *leaf, *number, n = 0;
  PetscLayout       layout;

  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Comm_rank(RunComm(), &rank));
  *rows = (BodyRows){rank ? 0 : s->n, rank ? s->n : 0, NULL};
  if (!b->subdomains) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscLayoutCreateFromSizes(BodiesComm(b), PETSC_DECIDE, s->nall, 1, &layout));
  PetscCall(PetscLayoutGetLocalSize(layout, &rows->n));
  PetscCall(PetscLayoutGetRange(layout, &rows->start, NULL));
  PetscCall(PetscMalloc2(s->n, &leaf, s->n, &number));
  for (PetscInt k = 0; k < s->n; k++) {
    if (!s->own[k]) continue;
    leaf[n]     = k;
    number[n++] = s->number[k];
  }
  PetscCall(PetscSFCreate(BodiesComm(b), &rows->sf));
  PetscCall(PetscSFSetGraphLayout(rows->sf, layout, n, leaf, PETSC_COPY_VALUES, number));
  PetscCall(PetscLayoutDestroy(&layout));
  PetscCall(PetscFree2(leaf, number));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode transfer_rows(const BodyRows *rows, PetscInt nlocal, size_t bytes, const void *from, void *to,
                                    PetscBool gather)
{
  MPI_Datatype unit;

  PetscFunctionBeginUser;
  if (!rows->sf) {
    PetscCall(PetscMemcpy(to, from, (size_t)(gather ? rows->n : nlocal) * bytes));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(RowTypeCreate((PetscInt)(bytes / sizeof(PetscReal)), &unit));
  if (gather) {
    PetscCall(PetscSFReduceBegin(rows->sf, unit, from, to, MPI_REPLACE));
    PetscCall(PetscSFReduceEnd(rows->sf, unit, from, to, MPI_REPLACE));
  } else {
    PetscCall(PetscSFBcastBegin(rows->sf, unit, from, to, MPI_REPLACE));
    PetscCall(PetscSFBcastEnd(rows->sf, unit, from, to, MPI_REPLACE));
  }
  PetscCall(RowTypeDestroy(&unit));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesGatherRows(Bodies b, const BodyRows *rows, size_t bytes, const void *from, void *row)
{
  PetscFunctionBeginUser;
  PetscCall(transfer_rows(rows, b->state.n, bytes, from, row, PETSC_TRUE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesScatterRows(Bodies b, const BodyRows *rows, size_t bytes, const void *row, void *to)
{
  PetscFunctionBeginUser;
  PetscCall(transfer_rows(rows, b->state.n, bytes, row, to, PETSC_FALSE));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesEndRows(BodyRows *rows)
{
  PetscFunctionBeginUser;
  PetscCall(PetscSFDestroy(&rows->sf));
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* v: `width` numbers of 64 bits per known body, saved or loaded in the order of the rows */
static PetscErrorCode visit_rows(Bodies b, const BodyRows *rows, State state, const char name[], PetscBool integers,
                                 PetscInt width, void *v)
{
  PetscReal *row;

  PetscFunctionBeginUser;
  PetscCall(PetscMalloc1(width * rows->n, &row));
  if (!StateIsLoading(state)) PetscCall(BodiesGatherRows(b, rows, width * sizeof(*row), v, row));
  PetscCall(StateRows(state, name, integers, width * rows->n, row));
  if (StateIsLoading(state)) PetscCall(BodiesScatterRows(b, rows, width * sizeof(*row), row, v));
  PetscCall(PetscFree(row));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesVisitReals(Bodies b, const BodyRows *rows, State state, const char name[], PetscInt width,
                                PetscReal v[])
{
  PetscFunctionBeginUser;
  if (rows->sf) PetscCall(visit_rows(b, rows, state, name, PETSC_FALSE, width, v));
  else PetscCall(StateReals(state, name, width * b->state.n, v));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesVisitOptional(Bodies b, State state, const char name[], PetscInt width, PetscReal v[])
{
  PetscBool has;
  BodyRows  rows;

  PetscFunctionBeginUser;
  PetscCall(StateHas(state, name, &has));
  if (!has) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(BodiesBeginRows(b, &rows));
  PetscCall(BodiesVisitReals(b, &rows, state, name, width, v));
  PetscCall(BodiesEndRows(&rows));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode BodiesVisitIntegers(Bodies b, const BodyRows *rows, State state, const char name[], PetscInt v[])
{
  PetscInt64 *wide;

  PetscFunctionBeginUser;
  if (!rows->sf) {
    PetscCall(StateInts(state, name, b->state.n, v));
    PetscFunctionReturn(PETSC_SUCCESS);
  }
  PetscCall(PetscMalloc1(b->state.n, &wide));
  for (PetscInt k = 0; k < b->state.n; k++) wide[k] = v[k];
  PetscCall(visit_rows(b, rows, state, name, PETSC_TRUE, 1, wide));
  for (PetscInt k = 0; k < b->state.n; k++) v[k] = (PetscInt)wide[k];
  PetscCall(PetscFree(wide));
  PetscFunctionReturn(PETSC_SUCCESS);
}
