/* ScalarBooks: see scalarbooks.h. */
#include "compat.h"
#include "impl.h"
#include "scalarbooks.h"

#define CORRECT 1e-4 /* of the content: what may appear beyond the prediction */

/* Heat of a scalar: of the last two steps, are they known; what has appeared and was not given back; both after the
   step; what is given back a time */
typedef struct {
  PetscReal have, content, content_old, owed, next_content, next_owed, given;
} Book;

struct _p_ScalarBooks {
  Couple  c;
  Scalars scalars;
  Book   *book; /* [number of scalars] */
};

PetscErrorCode ScalarBooksCreate(Couple c, Scalars scalars, ScalarBooks *books)
{
  ScalarBooks s;

  PetscFunctionBeginUser;
  PetscCall(PetscNew(&s));
  s->c       = c;
  s->scalars = scalars;
  PetscCall(PetscCalloc1(ScalarsCount(scalars), &s->book));
  *books = s;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksDestroy(ScalarBooks *books)
{
  PetscFunctionBeginUser;
  if (!*books) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(PetscFree((*books)->book));
  PetscCall(PetscFree(*books));
  PetscFunctionReturn(PETSC_SUCCESS);
}

static PetscErrorCode measure(ScalarBooks s, const ScalarMotion *m, PetscInt i, PetscReal sum[3])
{
  PetscFunctionBeginUser;
  PetscCall(ScalarsMeasureGrowth(s->scalars, i, m->V, m->skip, sum));
  PetscCall(MPIU_Allreduce(MPI_IN_PLACE, sum, 3, MPIU_REAL, MPIU_SUM, s->c->comm));
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksBegin(ScalarBooks s, const ScalarMotion *m, PetscInt i)
{
  Book     *b = s->book + i;
  PetscReal sum[3];

  PetscFunctionBeginUser;
  PetscCall(ScalarsFindGrowing(s->scalars, i, m->V, m->skip));
  PetscCall(measure(s, m, i, sum));
  b->content = b->content_old = sum[0];
  b->have                     = 1;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* *appears: heat a time that appears in the cells */
static PetscErrorCode close_book(ScalarBooks s, const ScalarMotion *m, PetscInt i, PetscReal others, PetscReal *appears)
{
  const FlowStep *f = s->c->step;
  Book           *b = s->book + i;
  PetscReal       sum[3];

  PetscFunctionBeginUser;
  PetscCall(measure(s, m, i, sum));
  b->next_content = sum[0];
  if (b->have == 0) b->content = b->content_old = (sum[1] - sum[2] - others) / (f->d0 + f->d1); /* what it began with */
  *appears = sum[1] - f->d0 * b->content - f->d1 * b->content_old - sum[2] - others;
  PetscFunctionReturn(PETSC_SUCCESS);
}

/* source [ncell_all] of cells that go along += rate over their volume. *any: there are such cells. Collective. */
static PetscErrorCode add_source(ScalarBooks s, const ScalarMotion *m, PetscReal rate, PetscReal source[],
                                 PetscBool *any)
{
  const MeshLocal *l      = s->c->loc;
  const PetscReal  one    = 1;
  PetscReal        volume = 0, each;

  PetscFunctionBeginUser;
  *any = PETSC_FALSE;
  for (PetscInt pass = 0; pass < 2; pass++) {
    for (PetscInt c = 0; c < l->ncell_all; c++) {
      PetscBool along = PETSC_FALSE;

      for (PetscInt j = 0; j < l->nb; j++) along = (PetscBool)(along || m->along[l->cell_node[c * l->nb + j]] > 0);
      if (!along || (m->skip && m->skip[c] >= 0)) continue;
      if (pass == 1) source[c] += rate / volume;
      else if (c < l->ncell) {
        PetscCall(ScalarsIntegrate(s->scalars, c, 0, &one, &each));
        volume += each;
      }
    }
    if (pass == 1) break;
    PetscCall(MPIU_Allreduce(MPI_IN_PLACE, &volume, 1, MPIU_REAL, MPIU_SUM, s->c->comm));
    if (volume == 0) break;
    *any = PETSC_TRUE;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksGiveBack(ScalarBooks s, const ScalarMotion *m, PetscInt i, PetscReal others,
                                   PetscReal source[])
{
  Book                   *b = s->book + i;
  PetscReal               appears, rate;
  PetscBool               any;
  const ScalarParameters *par;

  PetscFunctionBeginUser;
  b->given = 0;
  PetscCall(ScalarsGetParameters(s->scalars, i, &par));
  if (par->periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(ScalarsFindGrowing(s->scalars, i, m->V, m->skip));
  PetscCall(close_book(s, m, i, others, &appears));
  rate = -(b->owed / s->c->step->dt + appears);
  PetscCall(add_source(s, m, rate, source, &any));
  if (any) b->given = rate;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksCorrect(ScalarBooks s, const ScalarMotion *m, PetscInt i, PetscReal others,
                                  PetscReal source[], PetscBool *again)
{
  Book     *b       = s->book + i;
  PetscReal appears = 0, rate;

  PetscFunctionBeginUser;
  *again = PETSC_FALSE;
  if (b->given == 0) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(close_book(s, m, i, others, &appears));
  rate   = -(b->owed / s->c->step->dt + appears) - b->given;
  *again = (PetscBool)(PetscAbsReal(rate) * s->c->step->dt > CORRECT * PetscAbsReal(b->content));
  if (!*again) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(add_source(s, m, rate, source, again));
  b->given += rate;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksMeasure(ScalarBooks s, const ScalarMotion *m, PetscInt i, PetscReal others,
                                  PetscReal *covered)
{
  Book                   *b = s->book + i;
  const ScalarParameters *par;
  PetscReal               appears;

  PetscFunctionBeginUser;
  PetscCall(ScalarsGetParameters(s->scalars, i, &par));
  if (par->periodic_gradient) PetscFunctionReturn(PETSC_SUCCESS);
  PetscCall(close_book(s, m, i, others, &appears));
  b->next_owed = b->owed + (appears + b->given) * s->c->step->dt;
  *covered += appears + b->given;
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksAccept(ScalarBooks s)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < ScalarsCount(s->scalars); i++) {
    Book *b = s->book + i;

    b->content_old = b->content;
    b->content     = b->next_content;
    b->owed        = b->next_owed;
    b->have        = 1;
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}

PetscErrorCode ScalarBooksVisit(ScalarBooks s, const char what[], State state)
{
  PetscFunctionBeginUser;
  for (PetscInt i = 0; i < ScalarsCount(s->scalars); i++) {
    Book     *b       = s->book + i;
    PetscReal book[4] = {b->have, b->content, b->content_old, b->owed};
    char      name[64];

    PetscCall(PetscSNPrintf(name, sizeof(name), "%s_%d", what, (int)i));
    PetscCall(StateReals(state, name, 4, book));
    b->have        = book[0];
    b->content     = book[1];
    b->content_old = book[2];
    b->owed        = book[3];
  }
  PetscFunctionReturn(PETSC_SUCCESS);
}
